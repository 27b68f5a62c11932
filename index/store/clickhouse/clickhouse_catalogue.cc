// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/clickhouse_catalogue.h"

#include <algorithm>
#include <set>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "index/files/text.h"
#include "index/store/clickhouse/clickhouse_feed.h"
#include "index/store/clickhouse/query.h"
#include "index/store/draw_descriptors.h"
#include "index/store/refusals.h"
#include "index/store/unchanged.h"

namespace pliant::clickhouse {
namespace {

// Of this collection.
std::vector<ImageRecord> WithBytes(std::vector<PictureState> states,
                                   const CollectionEntry& collection) {
  std::vector<ImageRecord> records;
  for (const PictureState& state : states) {
    if (state.collection == collection.key) records.push_back(RecordOf(state, collection.name));
  }
  return records;
}

}  // namespace

ImageRecord RecordOf(const PictureState& state, const std::string& collection) {
  ImageRecord record = state.record;
  record.collection = collection;
  return record;
}

std::optional<ImageRecord> ClickhouseCatalogue::FindPicture(const std::string& collection,
                                                            const std::string& id) {
  const Snapshot now = snapshots_.Now();
  const CollectionEntry& in = now.registry->Require(collection);
  const auto state = states_.ById(in.key, id, now.log);
  if (!state) return std::nullopt;
  return RecordOf(*state, in.name);
}

std::optional<ImageRecord> ClickhouseCatalogue::FindBySha256(const std::string& collection,
                                                             const std::string& sha256) {
  const Snapshot now = snapshots_.Now();
  const CollectionEntry& in = now.registry->Require(collection);
  std::vector<ImageRecord> records = WithBytes(states_.BySha256({sha256}, now.log), in);
  if (records.empty()) return std::nullopt;
  return std::move(records.front());
}

std::optional<ImageRecord> ClickhouseCatalogue::FindUnchanged(const AddRequest& request,
                                                              const std::string& sha256) {
  const Snapshot now = snapshots_.Now();
  const CollectionEntry& in = now.registry->Require(request.collection);
  refusals::CheckIsMeant(request, in.created_ms);
  if (!request.id) return FindMeant(WithBytes(states_.BySha256({sha256}, now.log), in), request);
  const auto state = states_.ById(in.key, *request.id, now.log);
  if (!state || !IsUnchanged(state->record, request, sha256)) return std::nullopt;
  return RecordOf(*state, in.name);
}

std::optional<StoredPicture> ClickhouseCatalogue::FindDescribed(const std::string& sha256) {
  const Snapshot now = snapshots_.Now();
  for (const PictureState& state : states_.BySha256({sha256}, now.log)) {
    const CollectionEntry* collection = now.registry->Find(state.collection);
    auto features = states_.Features(NumbersByShard{{state.shard, {state.picture}}});
    if (features.empty()) continue;
    return StoredPicture{static_cast<std::int64_t>(state.version),
                         RecordOf(state, collection == nullptr ? "" : collection->name),
                         std::move(features.begin()->second)};
  }
  return std::nullopt;
}

std::vector<std::optional<StoredPicture>> ClickhouseCatalogue::LoadPictures(
    std::span<const PictureRef> refs, Load what) {
  if (refs.empty()) return {};
  const Snapshot now = snapshots_.Now();
  return LoadPicturesAt(states_, *now.registry, {now.log, now.log}, refs, what);
}

std::vector<std::uint8_t> ClickhouseCatalogue::ReadContent(const std::string& collection,
                                                           const std::string& id) {
  const Snapshot now = snapshots_.Now();
  const CollectionEntry& in = now.registry->Require(collection);
  const auto state = states_.ById(in.key, id, now.log);
  if (!state) throw refusals::NoPicture(collection, id);
  if (!state->content) {
    throw refusals::ContentNotKept(id);
  }
  const NativeBlock rows = link_.Read(link_.ShardOf(in.key, id),
                                      "SELECT data FROM originals WHERE sha256 = "
                                      "toFixedString(unhex(" +
                                          Literal(state->record.sha256) + "), 32) LIMIT 1",
                                      {{"data", "String"}});
  if (rows.rows == 0) {
    throw Error(ErrorCode::kCorrupt, "original_missing",
                "the stored bytes of image \"" + ToDisplayText(id) + "\" are lost");
  }
  const std::string& data = Row(rows, 0).Text(0);
  std::vector<std::uint8_t> bytes(data.begin(), data.end());
  if (Sha256Hex(bytes) != state->record.sha256) {
    throw Error(ErrorCode::kCorrupt, "original_corrupt",
                "the stored bytes of image \"" + ToDisplayText(id) + "\" are damaged");
  }
  return bytes;
}

Admission ClickhouseCatalogue::Admit(Key collection, const std::optional<std::string>& object,
                                     const Filter& filter,
                                     const std::vector<std::string>& without) {
  if (!object && filter.empty() && without.empty()) return {};
  const Snapshot now = snapshots_.Now();
  return AdmitAt(states_, {now.log, now.log}, static_cast<std::uint32_t>(collection), object,
                 filter, without);
}

std::unique_ptr<PartialSource> ClickhouseCatalogue::Partial() {
  std::vector<std::size_t> gone = link_.Gone();
  if (gone.empty()) return nullptr;
  if (gone.size() == link_.shards()) {
    throw Error(ErrorCode::kUnavailable, "shard_unavailable", "no shard of the cluster answers");
  }
  Snapshot now = gone.front() == ClusterLink::kHome ? snapshots_.LastKnown() : snapshots_.Now();
  return std::make_unique<ShardsThatAnswer>(&link_, &readable_, std::move(now), std::move(gone));
}

std::vector<VocabularyRecord> ClickhouseCatalogue::ListVocabularies(const std::string& collection) {
  const Snapshot now = snapshots_.Now();
  const CollectionEntry& in = now.registry->Require(collection);
  std::vector<VocabularyRecord> records;
  for (const auto& [key, entry] : now.registry->vocabularies) {
    if (entry.collection == in.key && entry.ready) records.push_back(now.registry->Describe(entry));
  }
  return records;
}

std::optional<VocabularyRecord> ClickhouseCatalogue::FindVocabulary(const std::string& collection,
                                                                    Key vocabulary) {
  const Snapshot now = snapshots_.Now();
  const CollectionEntry& in = now.registry->Require(collection);
  const VocabularyEntry* found = now.registry->FindVocabulary(in.key, vocabulary);
  if (found == nullptr) return std::nullopt;
  return now.registry->Describe(*found);
}

std::shared_ptr<const Vocabulary> ClickhouseCatalogue::ReadVocabulary(Key vocabulary) {
  return clickhouse::ReadVocabulary(link_, *snapshots_.Now().registry, vocabulary);
}

std::uint64_t ClickhouseCatalogue::CountPictures(Key collection) {
  const auto counts = CountAll(snapshots_.Now());
  const auto found = counts->find(static_cast<std::uint32_t>(collection));
  return found == counts->end() ? 0 : found->second.images;
}

std::vector<PictureOutline> Unquantized(PictureStates& states, std::uint32_t collection,
                                        std::uint64_t log, Key vocabulary, std::int64_t after,
                                        int limit) {
  OutlineQuery query{.collection = collection, .log = log};
  query.more = " AND v > " + std::to_string(after) +
               " AND number NOT IN (SELECT picture FROM words WHERE vocabulary = " +
               std::to_string(vocabulary) + ")";
  if (limit > 0) query.end = " ORDER BY v LIMIT " + std::to_string(limit);
  std::vector<PictureOutline> outlines = states.Outlines(query);
  std::sort(outlines.begin(), outlines.end(),
            [](const auto& a, const auto& b) { return a.version < b.version; });
  if (limit > 0 && outlines.size() > static_cast<std::size_t>(limit)) {
    outlines.resize(static_cast<std::size_t>(limit));
  }
  return outlines;
}

std::vector<StoredFeatures> FeaturesOf(PictureStates& states,
                                       const std::vector<PictureOutline>& pictures) {
  std::vector<std::uint64_t> numbers;
  for (const PictureOutline& outline : pictures) numbers.push_back(outline.picture);
  const auto blobs = states.Features(numbers);
  std::vector<StoredFeatures> features;
  for (const PictureOutline& outline : pictures) {
    const auto blob = blobs.find(outline.picture);
    if (blob == blobs.end()) {
      throw refusals::FeaturesMissing();
    }
    features.push_back({static_cast<std::int64_t>(outline.version), blob->second});
  }
  return features;
}

std::uint64_t ClickhouseCatalogue::CountUnquantized(const std::string& collection, Key vocabulary) {
  const Snapshot now = snapshots_.Now();
  return Unquantized(states_, now.registry->Require(collection).key, now.log, vocabulary, 0, 0)
      .size();
}

std::vector<StoredFeatures> ClickhouseCatalogue::LoadUnquantized(Key collection, Key vocabulary,
                                                                 std::int64_t after, int limit) {
  return FeaturesOf(states_, Unquantized(states_, static_cast<std::uint32_t>(collection),
                                         snapshots_.Now().log, vocabulary, after, limit));
}

DescriptorSample ClickhouseCatalogue::SampleDescriptors(Key collection, std::size_t count,
                                                        std::uint64_t seed) {
  const Snapshot now = snapshots_.Now();
  std::vector<PictureOutline> outlines =
      states_.Outlines({.collection = static_cast<std::uint32_t>(collection), .log = now.log});
  std::sort(outlines.begin(), outlines.end(),
            [](const auto& a, const auto& b) { return a.id < b.id; });
  std::vector<StoredCount> pictures;
  for (const PictureOutline& outline : outlines) {
    pictures.push_back({outline.picture, outline.keypoints});
  }
  return DrawDescriptors(
      now.registry->model.value().info, pictures, count, seed, [&](std::span<const Key> keys) {
        auto blobs = states_.Features(std::vector<std::uint64_t>(keys.begin(), keys.end()));
        std::vector<std::vector<std::uint8_t>> encoded;
        for (const Key key : keys) {
          encoded.push_back(std::move(blobs[static_cast<std::uint32_t>(key)]));
        }
        return encoded;
      });
}

}  // namespace pliant::clickhouse
