// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/search_reads.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/error.h"
#include "index/files/text.h"
#include "index/store/clickhouse/clickhouse_catalogue.h"
#include "index/store/refusals.h"

namespace pliant::clickhouse {
namespace {

std::string Committed(ReadAt at) {
  return at.committed < at.log ? " AND v <= " + std::to_string(at.committed) : std::string();
}

bool Has(const std::vector<std::size_t>& shards, std::size_t shard) {
  return std::find(shards.begin(), shards.end(), shard) != shards.end();
}

std::vector<std::size_t> Others(std::size_t count, const std::vector<std::size_t>& gone) {
  std::vector<std::size_t> others;
  for (std::size_t shard = 0; shard < count; ++shard) {
    if (!Has(gone, shard)) others.push_back(shard);
  }
  return others;
}

}  // namespace

std::vector<std::optional<StoredPicture>> LoadPicturesAt(PictureStates& states,
                                                         const Registry& registry, ReadAt at,
                                                         std::span<const PictureRef> refs,
                                                         Load what) {
  std::vector<std::optional<StoredPicture>> pictures(refs.size());
  std::vector<std::pair<std::uint32_t, std::string>> wanted;
  for (const PictureRef& ref : refs) {
    wanted.emplace_back(static_cast<std::uint32_t>(ref.collection), ref.id);
  }
  std::map<std::pair<std::uint32_t, std::string>, PictureState> found;
  NumbersByShard numbers;
  for (PictureState& state : states.ByRefs(wanted, at.log)) {
    if (state.version > at.committed) continue;
    numbers[state.shard].push_back(state.picture);
    std::pair key(state.collection, state.record.id);
    found.emplace(std::move(key), std::move(state));
  }
  const auto features = what == Load::kRecordsAndFeatures
                            ? states.Features(numbers)
                            : std::map<std::uint32_t, std::vector<std::uint8_t>>{};
  for (std::size_t i = 0; i < refs.size(); ++i) {
    const auto state = found.find(wanted[i]);
    if (state == found.end()) continue;
    const CollectionEntry* collection = registry.Find(wanted[i].first);
    if (collection == nullptr) continue;
    pictures[i] = StoredPicture{static_cast<std::int64_t>(state->second.version),
                                RecordOf(state->second, collection->name),
                                {}};
    if (what == Load::kRecords) continue;
    const auto blob = features.find(state->second.picture);
    if (blob == features.end()) throw refusals::FeaturesMissing();
    pictures[i]->features = blob->second;
  }
  return pictures;
}

Admission AdmitAt(PictureStates& states, ReadAt at, std::uint32_t collection,
                  const std::optional<std::string>& object, const Filter& filter,
                  const std::vector<std::string>& without) {
  Admission admission;
  admission.object = object;
  admission.filter = filter;
  admission.without = without;
  OutlineQuery query{.collection = collection, .log = at.log, .more = Committed(at)};
  if (object) {
    admission.object_key = ObjectKey(*object);
    OutlineQuery of_object = query;
    of_object.object = object;
    of_object.end = " LIMIT 1";
    admission.nothing = !object->empty() && states.Outlines(of_object).empty();
  }
  for (const PictureState& state : states.ByIds(collection, without, at.log)) {
    admission.without_versions.push_back(static_cast<std::int64_t>(state.version));
  }
  std::sort(admission.without_versions.begin(), admission.without_versions.end());
  if (filter.empty() || admission.nothing) return admission;
  query.metadata = true;
  std::vector<std::int64_t> passing;
  for (const PictureOutline& outline : states.Outlines(query)) {
    if (Passes(filter, outline.metadata)) {
      passing.push_back(static_cast<std::int64_t>(outline.version));
    }
  }
  std::sort(passing.begin(), passing.end());
  admission.versions = std::make_shared<const std::vector<std::int64_t>>(std::move(passing));
  return admission;
}

ReadablePictures::Versions ReadablePictures::Of(ClusterLink& link,
                                                const std::vector<std::size_t>& answering,
                                                std::uint32_t collection, ReadAt at) {
  {
    const std::lock_guard lock(mutex_);
    const auto known = entries_.find(collection);
    if (known != entries_.end() && known->second.answering == answering &&
        known->second.at.log == at.log && known->second.at.committed == at.committed) {
      return known->second.versions;
    }
  }
  const std::string statement =
      "SELECT v FROM (SELECT id, max(version) AS v, argMax(deleted, version) AS gone FROM pictures "
      "WHERE collection = " +
      std::to_string(collection) + " AND version <= " + std::to_string(at.log) +
      " GROUP BY id) WHERE gone = 0" + Committed(at);
  std::vector<std::int64_t> versions;
  for (const NativeBlock& block : link.ReadEach(answering, statement, {{"v", "UInt64"}})) {
    for (std::size_t i = 0; i < block.rows; ++i) versions.push_back(Row(block, i).Signed(0));
  }
  std::sort(versions.begin(), versions.end());
  auto shared = std::make_shared<const std::vector<std::int64_t>>(std::move(versions));
  const std::lock_guard lock(mutex_);
  entries_[collection] = {answering, at, shared};
  return shared;
}

ShardsThatAnswer::ShardsThatAnswer(ClusterLink* link, ReadablePictures* readable, Snapshot now,
                                   std::vector<std::size_t> gone)
    : link_(*link),
      readable_(*readable),
      now_(std::move(now)),
      gone_(std::move(gone)),
      answering_(Others(link_.shards(), gone_)),
      follows_(!Has(gone_, ClusterLink::kHome)),
      at_{follows_ ? now_.log : ReadAt::kNewest, now_.log},
      states_(link, answering_) {}

CollectionState ShardsThatAnswer::RequireCollection(const std::string& name) {
  const CollectionEntry& entry = now_.registry->Require(name);
  return {entry.key, entry.name, entry.vocabulary, entry.created_ms};
}

bool ShardsThatAnswer::IsGone(std::uint32_t collection, const std::string& id) {
  return Has(gone_, link_.ShardOf(collection, id));
}

std::vector<std::optional<StoredPicture>> ShardsThatAnswer::LoadPictures(
    std::span<const PictureRef> refs, Load what) {
  for (const PictureRef& ref : refs) {
    if (!IsGone(static_cast<std::uint32_t>(ref.collection), ref.id)) continue;
    throw Error(ErrorCode::kUnavailable, "shard_unavailable",
                "the shard of picture \"" + ToDisplayText(ref.id) + "\" does not answer");
  }
  auto pictures = LoadPicturesAt(states_, *now_.registry, at_, refs, what);
  for (std::size_t i = 0; i < refs.size(); ++i) {
    if (follows_ || refs[i].version != 0 || pictures[i]) continue;
    throw Error(ErrorCode::kUnavailable, "shard_unavailable",
                "shard 1, which knows whether there is a picture \"" + ToDisplayText(refs[i].id) +
                    "\", does not answer");
  }
  return pictures;
}

Admission ShardsThatAnswer::Admit(Key collection, const std::optional<std::string>& object,
                                  const Filter& filter, const std::vector<std::string>& without) {
  const auto in = static_cast<std::uint32_t>(collection);
  std::vector<std::string> here = without;
  std::erase_if(here, [&](const std::string& id) { return IsGone(in, id); });
  Admission admission = AdmitAt(states_, at_, in, object, filter, here);
  admission.without = without;
  if (!admission.versions) {
    admission.versions = readable_.Of(link_, answering_, in, at_);
  }
  return admission;
}

Coverage ShardsThatAnswer::Cover(Key collection) {
  Coverage coverage;
  coverage.shards = gone_.size() + answering_.size();
  coverage.answered = answering_.size();
  coverage.pictures =
      readable_.Of(link_, answering_, static_cast<std::uint32_t>(collection), at_)->size();
  return coverage;
}

}  // namespace pliant::clickhouse
