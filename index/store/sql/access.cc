// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/access.h"

#include <system_error>

#include "descriptor/base/error.h"
#include "index/store/database_url.h"

namespace pliant {

void Access::BeginWriting(std::function<void()> after_commit) {
  Guarded([&] {
    writer_ = std::make_unique<WriteQueue>(OpenWriter(), std::move(after_commit),
                                           [this](Connection& db) { Reclaim(db); });
  });
}

void Access::Write(WriteQueue::Work work, const WriteOptions& options) {
  if (!writer_) {
    throw Error(ErrorCode::kReadOnly, "read_only",
                "the database " + name() + " is open for reading only");
  }
  BeforeWrite();
  Guarded([&] {
    writer_->Run(
        [&](Connection& db) {
          work(db);
          BeforeCommit();
        },
        options);
  });
}

void Access::WriteAlone(const std::function<void(Connection& db)>& work) {
  BeforeWrite();
  Guarded([&] {
    const std::unique_ptr<Connection> db = OpenWriter();
    db->BeginWrite();
    work(*db);
    db->Commit();
  });
}

void Access::RequireSpace(std::uint64_t /*bytes*/,
                          const std::filesystem::path& /*directory*/) const {}

std::unique_ptr<Access> OpenAccess(const StoreOptions& options, StorePart part) {
  return IsDatabaseUrl(options.database.string()) ? OpenServerAccess(options, part)
                                                  : OpenFileAccess(options, part);
}

}  // namespace pliant
