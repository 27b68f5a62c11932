// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Private to index/store/.
#pragma once

#include <memory>

#include "index/store/change_feed.h"
#include "index/store/sql/access.h"

namespace pliant {

class SqlFeed : public ChangeFeed {
 public:
  explicit SqlFeed(Access* access) : access_(*access) {}

  std::int64_t Version() override { return access_.Version(); }
  std::unique_ptr<FeedView> Look() override;

 private:
  Access& access_;
};

}  // namespace pliant
