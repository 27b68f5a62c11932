// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/access.h"

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"

namespace pliant {

void Access::BeginWriting(std::function<void()> after_commit) {
  WithDatabaseErrors(path_, [&] {
    writer_ = std::make_unique<WriteQueue>(
        std::make_unique<Connection>(path_, Connection::Mode::kReadWrite, busy_timeout_ms_),
        std::move(after_commit));
  });
}

void Access::Write(WriteQueue::Work work, bool reclaim) {
  if (!writer_) {
    throw Error(ErrorCode::kReadOnly, "read_only",
                "the database " + DisplayPath(path_) + " is open for reading only");
  }
  WithDatabaseErrors(path_, [&] { writer_->Run(std::move(work), reclaim); });
}

void Access::WriteAlone(const std::function<void(Connection& db)>& work) {
  WithDatabaseErrors(path_, [&] {
    Connection db(path_, Connection::Mode::kReadWrite, busy_timeout_ms_);
    SQLite::Transaction transaction(db.database(), SQLite::TransactionBehavior::IMMEDIATE);
    work(db);
    transaction.commit();
  });
}

}  // namespace pliant
