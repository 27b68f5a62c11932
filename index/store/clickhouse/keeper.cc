// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/keeper.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <utility>

#include "descriptor/base/error.h"
#include "index/files/text.h"
#include "index/store/clickhouse/keeper_impl.h"

namespace pliant::clickhouse {
namespace {

constexpr int kTriesInARow = 4;

std::uint64_t ParseCounter(const std::string& text, const std::string& path) {
  std::uint64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) {
    throw Error(ErrorCode::kCorrupt, "keeper_corrupt",
                "the Keeper's " + path + " is no counter: " + ToDisplayText(text.substr(0, 100)));
  }
  return value;
}

}  // namespace

Keeper::Keeper(KeeperOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}

Keeper::~Keeper() = default;

std::optional<KeeperValue> Keeper::Read(const std::string& path) {
  const std::string absolute = impl_->Absolute(path);
  const KeeperAnswer answer = impl_->AskAgain(
      [&](KeeperSession& session) { return session.Get(absolute); }, impl_->CallEnd());
  if (answer.code == ZNONODE) return std::nullopt;
  if (answer.code != ZOK) throw impl_->Unexpected(answer.code, absolute);
  return KeeperValue{answer.text, answer.version, answer.made};
}

bool Keeper::Create(const std::string& path, const std::string& text) {
  const std::string absolute = impl_->Absolute(path);
  CheckKeeperText(text);
  const auto until = impl_->CallEnd();
  for (;;) {
    const KeeperAnswer answer = impl_->AskOnce(
        [&](KeeperSession& session) { return session.Create(absolute, text, ZOO_PERSISTENT); },
        until);
    if (answer.code == ZOK) return true;
    if (answer.code == ZNODEEXISTS) return false;
    if (answer.code != ZNONODE) throw impl_->Unexpected(answer.code, absolute);
    impl_->MakeParents(absolute, until);
  }
}

bool Keeper::Write(const std::string& path, const std::string& text, std::int32_t version) {
  const std::string absolute = impl_->Absolute(path);
  CheckKeeperText(text);
  if (version < 0) {
    throw Error(ErrorCode::kInvalidArgument, "keeper_version_invalid",
                "the version of " + absolute + " is below 0");
  }
  const KeeperAnswer answer =
      impl_->AskOnce([&](KeeperSession& session) { return session.Set(absolute, text, version); },
                     impl_->CallEnd());
  if (answer.code == ZBADVERSION || answer.code == ZNONODE) return false;
  if (answer.code != ZOK) throw impl_->Unexpected(answer.code, absolute);
  return true;
}

bool Keeper::Remove(const std::string& path) {
  const std::string absolute = impl_->Absolute(path);
  const KeeperAnswer answer = impl_->AskOnce(
      [&](KeeperSession& session) { return session.Delete(absolute); }, impl_->CallEnd());
  if (answer.code == ZNONODE) return false;
  if (answer.code == ZNOTEMPTY) {
    throw Error(ErrorCode::kConflict, "keeper_not_empty",
                absolute + " of the Keeper cannot be removed: something is below it");
  }
  if (answer.code != ZOK) throw impl_->Unexpected(answer.code, absolute);
  return true;
}

std::vector<std::string> Keeper::Children(const std::string& path) {
  const std::string absolute = impl_->Absolute(path);
  KeeperAnswer answer = impl_->AskAgain(
      [&](KeeperSession& session) { return session.Children(absolute); }, impl_->CallEnd());
  if (answer.code == ZNONODE) return {};
  if (answer.code != ZOK) throw impl_->Unexpected(answer.code, absolute);
  std::sort(answer.names.begin(), answer.names.end());
  return answer.names;
}

std::uint64_t Keeper::TakeNumbers(const std::string& path, std::uint64_t count,
                                  std::uint64_t start) {
  const std::string absolute = impl_->Absolute(path);
  const auto until = impl_->CallEnd();
  const Gate::Pass one_at_a_time(impl_->numbers, until);
  for (int tries = 1; one_at_a_time && KeeperSession::Clock::now() < until; ++tries) {
    const KeeperAnswer now =
        impl_->AskAgain([&](KeeperSession& session) { return session.Get(absolute); }, until);
    if (now.code != ZOK && now.code != ZNONODE) throw impl_->Unexpected(now.code, absolute);
    const bool fresh = now.code == ZNONODE;
    const std::uint64_t first = fresh ? start : ParseCounter(now.text, absolute);
    if (count > std::numeric_limits<std::uint64_t>::max() - first) {
      throw Error(ErrorCode::kConflict, "keeper_numbers_exhausted",
                  "the Keeper's " + absolute + " has no more numbers");
    }
    const std::string next = std::to_string(first + count);
    const KeeperAnswer taken = impl_->Try(
        [&](KeeperSession& session) {
          return fresh ? session.Create(absolute, next, ZOO_PERSISTENT)
                       : session.Set(absolute, next, now.version);
        },
        until);
    if (taken.code == ZOK) return first;
    // After trouble they may have been taken: then they are nobody's.
    const bool trouble = IsTrouble(taken.code);
    if (taken.code == ZNONODE && fresh) {
      impl_->MakeParents(absolute, until);
      continue;
    }
    if (!trouble && taken.code != ZNONODE && taken.code != ZNODEEXISTS &&
        taken.code != ZBADVERSION) {
      throw impl_->Unexpected(taken.code, absolute);
    }
    if (trouble && KeeperSession::Clock::now() >= until) {
      throw impl_->Unavailable("there was no answer in time");
    }
    // Who came first comes again at once, so one who paused would lose to it again.
    if (trouble || tries > kTriesInARow) PauseBriefly();
  }
  throw Error(ErrorCode::kUnavailable, "keeper_busy",
              "too many take numbers from the Keeper's " + absolute);
}

}  // namespace pliant::clickhouse
