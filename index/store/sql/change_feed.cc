// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The change feed: Access::Version says whether anybody has committed, new images have greater
// keys, removed ones are in the table `removals`.
#include "index/store/change_feed.h"

#include <algorithm>
#include <future>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "index/records/index_share.h"
#include "index/store/blob_codec.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/rows.h"
#include "index/store/store.h"

namespace pliant {
namespace {

constexpr std::size_t kRowsAtOnce = 128;  // a database may send all rows before the first is read

// A row of an image.
struct Stored {
  IndexedImage image;
  std::vector<std::uint8_t> words;
  std::vector<std::uint8_t> features;

  void Quantize(const Quantizer& quantizer) {
    try {
      const CodedDescriptors descriptors = DescriptorsIn(features);
      const Descriptors& of_words = quantizer.vocabulary().words;
      const auto decoded = DecodeWords(words, of_words.rows);
      if (decoded.size() != descriptors.rows || descriptors.kind != of_words.kind ||
          descriptors.dim != of_words.dim) {
        throw Error(ErrorCode::kCorrupt, "words_corrupt", "its words are not of its descriptors");
      }
      image.bow = quantizer.BowOf(descriptors, decoded);
    } catch (const Error& error) {
      throw Error(error.code(), error.reason(), "image \"" + image.id + "\": " + error.what());
    }
  }
};

class SqlFeedView : public FeedView {
  template <typename Work>  // before its users, which need its type
  auto Read(const Work& work) {
    return access_.Guarded([&] { return work(reading_->db()); });
  }

 public:
  SqlFeedView(Access* access, const IndexShare& share)
      : access_(*access), share_(share), reading_(access->BeginReading()) {}

  FeedPosition Position() override {
    return Read([this](Connection& db) { return access_.Position(db); });
  }

  std::vector<CollectionState> Collections() override {
    return Read([](Connection& db) {
      std::vector<CollectionState> states;
      for (const CollectionRow& row : AllCollections(db)) states.push_back(StateOf(row));
      return states;
    });
  }

  std::optional<std::vector<std::int64_t>> RemovedSince(const FeedPosition& at) override {
    return Read([&](Connection& db) -> std::optional<std::vector<std::int64_t>> {
      const FeedPosition now = access_.Position(db);
      if (!now.Continues(at)) return std::nullopt;
      std::vector<std::int64_t> removed;
      Cursor row = db.Prepare("SELECT seq, image FROM removals WHERE seq > ? ORDER BY seq");
      row.Bind(at.removal);
      std::int64_t first = now.removal + 1;
      while (row.Next()) {
        first = std::min(first, row.Int(0));
        removed.push_back(row.Int(1));
      }
      // Numbers have no gaps: when the first is not the next one, older ones have been dropped.
      if (now.removal > at.removal && first != at.removal + 1) return std::nullopt;
      return removed;
    });
  }

  std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) override {
    return Read([&](Connection& db) { return pliant::ReadVocabulary(db, vocabulary); });
  }

  std::uint64_t CountImages(Key collection) override {
    return Read([&](Connection& db) {
      return CountImagesIn(db, collection) / static_cast<std::uint64_t>(share_.parts);
    });
  }

  // The database reads, all cores make codes, and `work` builds at the same time.
  void ForEachImage(Key vocabulary, const Quantizer& quantizer, std::int64_t after,
                    std::size_t chunk,
                    const std::function<void(std::vector<IndexedImage>)>& work) override {
    std::vector<IndexedImage> images;
    std::future<void> working;
    const auto pass_on = [&] {
      if (working.valid()) working.get();
      working = std::async(std::launch::async, work, std::exchange(images, {}));
    };
    const auto read = [&] { return ReadBatch(vocabulary, after); };
    std::future<Batch> next = std::async(std::launch::async, read);
    for (bool more = true; more;) {
      Batch batch = next.get();
      after = batch.last;
      more = batch.more;
      if (more) next = std::async(std::launch::async, read);
      ParallelFor(batch.images.size(), 0,
                  [&](std::size_t i) { batch.images[i].Quantize(quantizer); });
      for (Stored& one : batch.images) {
        images.push_back(std::move(one.image));
        if (images.size() == chunk) pass_on();
      }
    }
    if (!images.empty()) pass_on();
    if (working.valid()) working.get();
  }

  bool IsSigned(Key vocabulary, const std::string& signature) override {
    return Read([&](Connection& db) {
      return db.Prepare("SELECT 1 FROM saved_indexes WHERE signature = ? AND vocabulary = ?")
          .Bind(signature, vocabulary)
          .Next();
    });
  }

 private:
  struct Batch {
    std::vector<Stored> images;  // of the share
    std::int64_t last = 0;       // version
    bool more = false;
  };
  Batch ReadBatch(Key vocabulary, std::int64_t after) {
    return Read([&](Connection& db) {
      Batch batch;
      // Every table has its bound: PostgreSQL would read all rows before it otherwise. The share
      // is no condition: it would sort all rows for the few that it expects.
      const std::string share = OfShare();
      Cursor row = db.Prepare(
          "SELECT p.key, p.object, p.id, w.data, f.data, CASE WHEN " + share +
          " THEN 1 ELSE 0 END FROM image_words w JOIN images p ON p.key = w.image LEFT JOIN "
          "features f ON f.image = w.image AND f.image > ? AND " +
          share + " WHERE w.vocabulary = ? AND w.image > ? AND p.key > ? ORDER BY w.image LIMIT ?");
      row.Bind(after, vocabulary, after, after, kRowsAtOnce);
      std::size_t read = 0;
      for (; row.Next(); ++read) {
        batch.last = row.Int(0);
        if (row.Int(5) == 0) continue;
        if (row.IsNull(4)) throw refusals::FeaturesMissing();
        Stored& one = batch.images.emplace_back();
        one.image.key = batch.last;
        one.image.object = row.IsNull(1) ? 0 : row.Int(1);
        one.image.id = row.Text(2);
        one.words = row.CopyOfBlob(3);
        one.features = row.CopyOfBlob(4);
      }
      batch.more = read == kRowsAtOnce;
      return batch;
    });
  }

  // Only PostgreSQL stores have shares. The hash must never change: files of the index rely on it.
  std::string OfShare() const {
    if (share_.parts == 1) return "1 = 1";
    return "('x' || left(encode(sha256(convert_to(p.id, 'UTF8')), 'hex'), 6))::bit(24)::int % " +
           std::to_string(share_.parts) + " = " + std::to_string(share_.part - 1);
  }

  Access& access_;
  const IndexShare share_;
  const std::unique_ptr<ReadTransaction> reading_;
};

class SqlFeed : public ChangeFeed {
 public:
  SqlFeed(Access* access, const IndexShare& share) : access_(*access), share_(share) {}

  std::int64_t Version() override { return access_.Version(); }
  std::unique_ptr<FeedView> Poll() override {
    return access_.Guarded([&] { return std::make_unique<SqlFeedView>(&access_, share_); });
  }
  void SignSaved(Key vocabulary, const std::string& signature,
                 const std::string& forgotten) override {
    access_.Write([&](Connection& db) {
      db.Prepare("DELETE FROM saved_indexes WHERE signature = ?").Bind(forgotten).Run();
      db.Prepare("INSERT INTO saved_indexes (signature, vocabulary) VALUES (?, ?)")
          .Bind(signature, vocabulary)
          .Run();
    });
  }

 private:
  Access& access_;
  const IndexShare share_;
};

}  // namespace

std::unique_ptr<ChangeFeed> Store::OpenFeed(const IndexShare& share) {
  return std::make_unique<SqlFeed>(access_.get(), share);
}

}  // namespace pliant
