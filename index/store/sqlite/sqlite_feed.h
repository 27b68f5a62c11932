// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The change feed of a database file: PRAGMA data_version says whether anybody has committed, new
// pictures have greater keys, removed ones are in the table `removals`. Private to store/sqlite.
#pragma once

#include <memory>
#include <mutex>

#include "index/store/change_feed.h"
#include "index/store/sqlite/access.h"

namespace pliant {

class SqliteFeed : public ChangeFeed {
 public:
  explicit SqliteFeed(Access* access);

  std::int64_t Version() override;
  std::unique_ptr<FeedView> Look() override;

 private:
  Access& access_;
  std::mutex mutex_;  // guards watch_
  // data_version tells of commits by other connections than the one that asks: this one never
  // writes, and is never in a transaction, within which the version stands still.
  std::unique_ptr<Connection> watch_;
};

}  // namespace pliant
