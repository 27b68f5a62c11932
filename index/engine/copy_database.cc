// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/copy_database.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "index/files/durable_file.h"
#include "index/files/text.h"
#include "index/store/blob_codec.h"
#include "index/store/open_store.h"

namespace pliant {
namespace {

constexpr int kReaders = 32;  // images that are read at once, while the database waits
constexpr std::uint64_t kBytesTogether = 64 << 20;  // of features and uploaded bytes, in one commit

bool SameRecord(const ImageRecord& a, const ImageRecord& b) {
  return a.sha256 == b.sha256 && a.object == b.object && a.metadata == b.metadata &&
         a.source == b.source;
}

// An image on its way.
struct Copied {
  StoredImage stored;
  std::vector<std::uint8_t> content = {};
  bool has_content = true;
  AddRequest request = {};  // its bytes are `content`
  Features features = {};
  std::optional<std::vector<std::uint32_t>> words = {};
};
using Together = std::vector<Copied>;  // written in one commit

class Copy {
 public:
  explicit Copy(const CopyOptions& options) : options_(options) {
    if (options.from == options.to) {
      throw Error(ErrorCode::kInvalidArgument, "same_database",
                  "a database cannot be copied into itself");
    }
    from_ = OpenStore(
        {.database = options.from, .create = false, .read_only = true, .model_of_new = {}});
    from_->OpenOriginals(std::nullopt, false);
    to_ =
        OpenStore({.database = options.to, .model_of_new = [this] { return from_->model().info; }});
    if (from_->model().info.model_id != to_->model().info.model_id) {
      throw Error(ErrorCode::kConflict, "model_mismatch",
                  options.from.string() + " was made with " + from_->model().info.model_id +
                      ", and " + options.to.string() + " with " + to_->model().info.model_id);
    }
    to_->SettleExtraction(from_->model().limits);
    to_->OpenOriginals(std::nullopt, true);
    to_->BeginWriting([] {});
  }

  CopyResult Run() {
    std::uint64_t total = 0;
    const std::vector<CollectionLabel> labels = from_->catalogue().ListLabels();
    for (const CollectionLabel& label : labels) {
      total += from_->catalogue().DescribeCollection(label.name).images;
    }
    total_ = total;
    AliasChanges aliases;
    for (const CollectionLabel& label : labels) {
      CopyCollection(label);
      for (const std::string& alias : label.aliases) aliases[alias] = label.name;
    }
    if (!aliases.empty()) to_->writer().ChangeAliases(aliases);
    CopyKeys();
    return result_;
  }

 private:
  void ThrowIfStopped() const {
    if (options_.stop.stop_requested()) {
      throw Error(ErrorCode::kCancelled, "cancelled",
                  "the copy was stopped; what was copied stays, and the next copy goes on there");
    }
  }

  void CopyCollection(const CollectionLabel& label) {
    to_->writer().CreateCollection(label.name);
    const double found_from = from_->catalogue().RequireCollection(label.name).found_from;
    to_->writer().ChangeCollection(label.name,
                                   {.display_name = label.display_name, .found_from = found_from});
    ++result_.collections;
    CopyVocabularies(label.name);
    const CollectionState to = to_->catalogue().RequireCollection(label.name);
    active_ = to.vocabulary;
    words_ = 0;
    if (active_ != 0) words_ = to_->catalogue().ReadVocabulary(active_)->size();
    same_ = from_->catalogue().RequireCollection(label.name).vocabulary;
    if (same_ != 0 && FindSame(label.name, *from_->catalogue().ReadVocabulary(same_)) != active_) {
      same_ = 0;  // somebody has chosen another one in the target
    }
    ImageListing list;
    list.which.collection = label.name;
    list.limit = options_.commit_every;
    std::uint64_t seen = 0;
    from_->catalogue().ForEachImagePage(list, [&](const ImagePage& page) {
      ThrowIfStopped();
      CopyPage(label.name, page.records);
      seen += page.records.size();
    });
    Written();
    const std::uint64_t there = to_->catalogue().DescribeCollection(label.name).images;
    result_.extra += there > seen ? there - seen : 0;
  }

  // Those that are not there, or otherwise.
  std::vector<ImageRecord> Missing(const std::string& collection,
                                   const std::vector<ImageRecord>& records) {
    const Key in = to_->catalogue().RequireCollection(collection).key;
    std::vector<ImageRef> refs;
    for (const ImageRecord& record : records) refs.push_back({in, record.id});
    const auto there = to_->catalogue().LoadImages(refs, Load::kRecords);
    std::vector<ImageRecord> missing;
    for (std::size_t i = 0; i < records.size(); ++i) {
      if (!there[i] || !SameRecord(there[i]->record, records[i])) missing.push_back(records[i]);
    }
    return missing;
  }

  // While this page is read and quantised, what was read before is written.
  void CopyPage(const std::string& collection, const std::vector<ImageRecord>& records) {
    const std::vector<ImageRecord> missing = Missing(collection, records);
    result_.unchanged += records.size() - missing.size();
    const Key in = from_->catalogue().RequireCollection(collection).key;
    std::vector<ImageRef> refs;
    for (const ImageRecord& record : missing) refs.push_back({in, record.id});
    Together together;
    std::uint64_t bytes = 0;
    for (auto& image : from_->catalogue().LoadImages(refs, Load::kRecordsAndFeatures)) {
      if (!image) continue;  // removed meanwhile
      bytes += image->record.bytes + image->features.size();
      together.push_back({.stored = *std::move(image)});
      if (bytes < kBytesTogether) continue;
      ReadAndWrite(collection, std::exchange(together, {}));
      bytes = 0;
    }
    ReadAndWrite(collection, std::move(together));
  }

  void ReadAndWrite(const std::string& collection, Together together) {
    Read(collection, together);
    ReadWords(together);
    Written();
    if (together.empty()) return;
    writing_ = std::async(std::launch::async, [this, images = std::move(together)]() mutable {
      Write(images);
      return images.size();
    });
  }

  // Of the same vocabulary, they need not be made again.
  void ReadWords(Together& together) {
    if (active_ == 0 || same_ == 0) return;
    std::vector<Key> versions;
    for (const Copied& one : together) versions.push_back(one.stored.version);
    auto words = from_->catalogue().LoadWords(same_, words_, versions);
    for (Copied& one : together) {
      const auto found = words.find(one.stored.version);
      if (found != words.end()) one.words = std::move(found->second);
    }
  }

  // Returns when all is written that was read, and counts it.
  void Written() {
    if (writing_.valid()) result_.copied += writing_.get();
    if (options_.progress) options_.progress(result_.copied + result_.unchanged, total_);
  }

  void Read(const std::string& collection, Together& together) {
    ParallelFor(together.size(), kReaders, [&](std::size_t i) { Read(collection, together[i]); });
    result_.without_content += static_cast<std::uint64_t>(std::count_if(
        together.begin(), together.end(), [](const Copied& one) { return !one.has_content; }));
  }

  void Read(const std::string& collection, Copied& one) {
    const ImageRecord& record = one.stored.record;
    try {
      one.content = from_->catalogue().ReadContent(collection, record.id);
    } catch (const Error& error) {
      if (error.reason() != "content_not_kept" && error.reason() != "original_missing" &&
          error.reason() != "original_corrupt") {
        throw;
      }
      one.has_content = false;
    }
    one.request.collection = collection;
    one.request.id = record.id;
    one.request.object = record.object;
    one.request.metadata = record.metadata;
    one.request.source = record.source;
    one.request.bytes = one.content;
    one.features = DecodeFeatures(one.stored.features);
  }

  void Write(Together& together) {
    std::vector<ImagePut> puts;
    for (Copied& one : together) {
      ImagePut& put = puts.emplace_back(ImagePut{.request = one.request});
      put.record = std::move(one.stored.record);
      put.encoded = std::move(one.stored.features);
      put.features = std::move(one.features);
      if (one.words) {  // else the writer makes it
        put.vocabulary = active_;
        put.words = *std::move(one.words);
      }
      put.keep_content = one.has_content;
      put.keep_times = true;
    }
    to_->writer().PutAll(puts);
  }

  // The vocabulary of the target that is the same; 0 = none.
  Key FindSame(const std::string& collection, const Vocabulary& vocabulary) {
    const std::uint32_t checksum = VocabularyChecksum(vocabulary);
    for (const VocabularyRecord& record : to_->catalogue().ListVocabularies(collection)) {
      if (record.words == vocabulary.size() &&
          VocabularyChecksum(*to_->catalogue().ReadVocabulary(record.id)) == checksum) {
        return record.id;
      }
    }
    return 0;
  }

  void CopyVocabularies(const std::string& collection) {
    for (const VocabularyRecord& record : from_->catalogue().ListVocabularies(collection)) {
      const auto vocabulary = from_->catalogue().ReadVocabulary(record.id);
      const Quantizer quantizer(vocabulary);
      Key key = FindSame(collection, *vocabulary);
      const bool is_new = key == 0;
      if (is_new) {
        key = to_->writer().AddVocabulary(to_->catalogue().RequireCollection(collection).key,
                                          *vocabulary);
      }
      const bool automatic = from_->catalogue().DescribeCollection(collection).automatic;
      if (is_new || record.active) {
        to_->writer().Quantize(to_->catalogue().RequireCollection(collection).key, key, quantizer,
                               /*threads=*/0, [this](std::uint64_t) { ThrowIfStopped(); });
      }
      if (is_new) {
        to_->writer().FinishVocabulary(collection, key, quantizer, automatic);
        ++result_.vocabularies;
      }
      const bool is_active = to_->catalogue().RequireCollection(collection).vocabulary == key;
      if (record.active && !is_active) {
        to_->writer().SetActiveVocabulary(collection, key, quantizer, automatic);
      }
    }
  }

  void CopyKeys() {
    std::set<std::string> there;
    const auto to = OpenServiceStore(options_.to);
    for (const ApiKeyRecord& key : to->Keys()) there.insert(key.id);
    for (const ApiKeyRecord& key : OpenServiceStore(options_.from)->Keys()) {
      if (key.revoked_ms != 0 || !there.insert(key.id).second) continue;
      to->AddKey(key);
      ++result_.keys;
    }
  }

  const CopyOptions& options_;
  std::unique_ptr<Store> from_;
  std::unique_ptr<Store> to_;
  std::uint64_t total_ = 0;
  Key active_ = 0;         // vocabulary of the collection that is copied into
  std::size_t words_ = 0;  // of it
  Key same_ = 0;           // the same one in `from`; 0 = it is not active there
  CopyResult result_;
  std::future<std::size_t> writing_;  // last: it uses what stands above
};

constexpr double kSameScore = 1e-5;

std::map<std::string, double> ScoresOf(const SearchResult& result) {
  std::map<std::string, double> scores;
  for (const Hit& hit : result.hits) scores[hit.image_id] = hit.score;
  return scores;
}

// Where equal scores end a page, either of the images may be the last on it.
bool SameHits(const SearchResult& a, const SearchResult& b) {
  if (a.hits.size() != b.hits.size()) return false;
  const std::map<std::string, double> other = ScoresOf(b);
  for (std::size_t i = 0; i < a.hits.size(); ++i) {
    if (std::abs(a.hits[i].score - b.hits[i].score) > kSameScore) return false;
    const auto found = other.find(a.hits[i].image_id);
    const double last = a.hits.back().score;
    if (found == other.end() && std::abs(a.hits[i].score - last) > kSameScore) return false;
    if (found != other.end() && std::abs(found->second - a.hits[i].score) > kSameScore) {
      return false;
    }
  }
  return true;
}

}  // namespace

CopyResult CopyDatabase(const CopyOptions& options) { return Copy(options).Run(); }

RankingsCompared CompareRankings(Engine& from, Engine& to, std::uint64_t count) {
  RankingsCompared compared;
  for (const std::string& collection : from.ListCollections()) {
    const CollectionRecord record = from.GetCollection(collection);
    if (!record.vocabulary || record.images == 0) continue;
    const std::uint64_t step =
        std::max<std::uint64_t>(1, record.images / std::max<std::uint64_t>(1, count));
    std::uint64_t number = 0;
    ImageListing list;
    list.which.collection = collection;
    list.limit = 1000;
    from.ForEachPage(list, [&](const ImagePage& page) {
      for (const ImageRecord& image : page.records) {
        if (number++ % step != 0 || compared.compared >= count) continue;
        SearchOptions search;
        search.collection = collection;
        search.group_by = GroupBy::kImage;
        search.limit = 10;
        const Features features = from.GetFeatures(collection, image.id);
        ++compared.compared;
        if (SameHits(from.SearchFeatures(features, search), to.SearchFeatures(features, search))) {
          continue;
        }
        compared.differences.push_back("a search with image \"" + ToDisplayText(image.id) +
                                       "\" of collection \"" + collection +
                                       "\" has other hits, or other scores");
      }
    });
  }
  return compared;
}

}  // namespace pliant
