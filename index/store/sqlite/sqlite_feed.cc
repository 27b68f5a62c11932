// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/sqlite_feed.h"

#include <algorithm>
#include <string>
#include <utility>

#include "index/store/sqlite/catalogue.h"
#include "index/store/sqlite/catalogue_vocabularies.h"
#include "index/store/word_codec.h"

namespace pliant {
namespace {

constexpr const char* kLastKey =
    "SELECT coalesce((SELECT seq FROM sqlite_sequence WHERE name = ?), 0)";

class SqliteFeedView : public FeedView {
  template <typename Work>  // before its users, which need its type
  auto Read(Work&& work) {
    return WithDatabaseErrors(access_.path(), std::forward<Work>(work));
  }
  std::int64_t LastKey(const char* table) {
    return db_->Prepare(kLastKey).Bind(std::string(table)).One().Int(0);
  }

 public:
  explicit SqliteFeedView(Access* access)
      : access_(*access), db_(access->readers().Borrow()), reading_(db_->database()) {}

  FeedPosition Position() override {
    return Read([&] { return FeedPosition{LastKey("pictures"), LastKey("removals")}; });
  }

  std::vector<CollectionState> Collections() override {
    return Read([&] {
      std::vector<CollectionState> states;
      for (const CollectionRow& row : AllCollections(*db_)) states.push_back(StateOf(row));
      return states;
    });
  }

  std::optional<std::vector<std::int64_t>> RemovedSince(std::int64_t removal) override {
    return Read([&]() -> std::optional<std::vector<std::int64_t>> {
      const std::int64_t newest = LastKey("removals");
      std::vector<std::int64_t> removed;
      Cursor row = db_->Prepare("SELECT seq, picture FROM removals WHERE seq > ? ORDER BY seq");
      row.Bind(removal);
      std::int64_t first = newest + 1;
      while (row.Next()) {
        first = std::min(first, row.Int(0));
        removed.push_back(row.Int(1));
      }
      // Numbers have no gaps: when the first is not the next one, older ones have been dropped.
      if (newest > removal && first != removal + 1) return std::nullopt;
      return removed;
    });
  }

  std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) override {
    return Read([&] { return pliant::ReadVocabulary(*db_, vocabulary); });
  }

  std::uint64_t CountPictures(Key collection) override {
    return Read([&] { return CountPicturesIn(*db_, collection); });
  }

  void ForEachPicture(Key vocabulary, std::size_t words, std::int64_t after, std::size_t chunk,
                      const std::function<void(std::vector<IndexedPicture>)>& work) override {
    Read([&] {
      Cursor row = db_->Prepare(
          "SELECT p.key, p.object, p.id, w.data FROM picture_words w JOIN pictures p ON p.key = "
          "w.picture WHERE w.vocabulary = ? AND w.picture > ? ORDER BY w.picture");
      row.Bind(vocabulary, after);
      std::vector<IndexedPicture> pictures;
      while (row.Next()) {
        pictures.push_back({row.Int(0), row.IsNull(1) ? 0 : row.Int(1), row.Text(2),
                            DecodeBow(row.Blob(3), words)});
        if (pictures.size() == chunk) work(std::exchange(pictures, {}));
      }
      if (!pictures.empty()) work(std::move(pictures));
    });
  }

 private:
  Access& access_;
  ConnectionPool::Lease db_;
  SQLite::Transaction reading_;
};

}  // namespace

SqliteFeed::SqliteFeed(Access* access) : access_(*access) {
  watch_ = WithDatabaseErrors(access_.path(), [&] {
    return std::make_unique<Connection>(access_.path(), Connection::Mode::kReadOnly,
                                        access_.busy_timeout_ms());
  });
}

std::int64_t SqliteFeed::Version() {
  return WithDatabaseErrors(access_.path(), [&] {
    const std::lock_guard lock(mutex_);
    return watch_->Scalar("PRAGMA data_version");
  });
}

std::unique_ptr<FeedView> SqliteFeed::Look() {
  return WithDatabaseErrors(access_.path(),
                            [&] { return std::make_unique<SqliteFeedView>(&access_); });
}

}  // namespace pliant
