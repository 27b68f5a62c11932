// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// ClickhouseWriter: pictures.
#include "index/store/clickhouse/clickhouse_writer.h"

#include <algorithm>

#include "descriptor/base/error.h"
#include "index/files/merge_patch.h"
#include "index/files/text.h"
#include "index/store/clickhouse/clickhouse_feed.h"
#include "index/store/refusals.h"
#include "index/store/unchanged.h"
#include "index/store/word_codec.h"

namespace pliant::clickhouse {
namespace {

std::optional<ImageRecord> FindUnchangedIn(Change& change, const CollectionEntry& collection,
                                           const AddRequest& request, const std::string& sha256) {
  if (!request.id) {
    std::vector<ImageRecord> same;
    for (const PictureState& state : change.FindBySha256(collection.key, sha256)) {
      same.push_back(RecordOf(state, collection.name));
    }
    return FindMeant(same, request);
  }
  const auto found = change.Find(collection.key, *request.id);
  if (!found || !IsUnchanged(found->record, request, sha256)) return std::nullopt;
  return RecordOf(*found, collection.name);
}

const std::string& FirstId(const std::vector<PictureOutline>& pictures) {
  return std::min_element(pictures.begin(), pictures.end(),
                          [](const auto& a, const auto& b) { return a.id < b.id; })
      ->id;
}

}  // namespace

std::vector<PutOutcome> ClickhouseWriter::PutAll(std::span<const PicturePut> puts) {
  Foreseen foreseen;
  for (const PicturePut& put : puts) {
    foreseen.pictures.emplace_back(put.request.collection, put.record.id);
    if (put.request.id) continue;
    foreseen.pictures.emplace_back(put.request.collection, put.record.sha256);
    foreseen.sha256.push_back(put.record.sha256);
  }
  std::vector<PutOutcome> outcomes(puts.size());
  const auto store = [&](Change& change) {
    for (std::size_t i = 0; i < puts.size(); ++i) outcomes[i] = Store(change, puts[i]);
  };
  commits_.Run(store, foreseen);
  return outcomes;
}

PutOutcome ClickhouseWriter::Store(Change& change, const PicturePut& put) {
  const AddRequest& request = put.request;
  const CollectionEntry collection = change.registry().Require(request.collection);
  refusals::CheckIsMeant(request, collection.created_ms);
  // Somebody else may have stored the same while this picture was described.
  if (auto unchanged = FindUnchangedIn(change, collection, request, put.record.sha256)) {
    if (put.check) put.check(&*unchanged);
    return {AddOutcome::kUnchanged, *std::move(unchanged)};
  }
  PictureState state;
  state.collection = collection.key;
  state.record = put.record;
  state.record.collection.clear();
  auto replaced = change.Find(collection.key, state.record.id);
  if (replaced && !request.id) {  // a generated id that was given to another picture by name
    state.record.id = state.record.sha256;
    replaced = change.Find(collection.key, state.record.id);
  }
  if (put.check) {
    const auto now = replaced ? std::optional(RecordOf(*replaced, collection.name)) : std::nullopt;
    put.check(now ? &*now : nullptr);
  }
  const std::string& id = state.record.id;
  state.record.object = request.object;
  if (!put.keep_times) state.record.added_ms = state.record.updated_ms = NowMs();
  state.picture = change.NewPicture();
  state.content = put.keep_content;
  change.AddFeatures(collection.key, id, state.picture, put.encoded);
  if (put.keep_content) {
    change.AddOriginal(collection.key, id, state.record.sha256, request.bytes);
  }
  if (collection.vocabulary != 0) {
    Bow bow = put.bow;
    if (collection.vocabulary != put.vocabulary) {  // switched since
      const Quantizer quantizer(ReadVocabulary(link_, change.registry(), collection.vocabulary));
      const Descriptors& descriptors = put.features.descriptors;
      bow = quantizer.BowOf(descriptors, 0, quantizer.Assign(descriptors, request.threads));
    }
    change.AddWords(collection.key, id, collection.vocabulary, state.picture, EncodeBow(bow));
  }
  change.Put(state, replaced);
  return {replaced ? AddOutcome::kReplaced : AddOutcome::kCreated,
          RecordOf(state, collection.name)};
}

void ClickhouseWriter::RestoreContent(const ImageRecord& stored, Bytes bytes) {
  try {
    catalogue_.ReadContent(stored.collection, stored.id);
    return;
  } catch (const Error& error) {
    if (error.reason() != "original_missing" && error.reason() != "original_corrupt") return;
  }
  commits_.Run([&](Change& change) {
    const CollectionEntry& collection = change.registry().Require(stored.collection);
    const auto now = change.Find(collection.key, stored.id);
    if (!now || now->record.sha256 != stored.sha256) return;
    change.AddOriginal(collection.key, stored.id, stored.sha256, bytes);
  });
}

ImageRecord ClickhouseWriter::ChangePicture(const std::string& collection, const std::string& id,
                                            const PictureChange& change) {
  ImageRecord changed;
  commits_.Run(
      [&](Change& commit) {
        const CollectionEntry in = commit.registry().Require(collection);
        const auto now = commit.Find(in.key, id);
        if (!now) {
          throw refusals::NoPicture(collection, id);
        }
        changed = RecordOf(*now, in.name);
        if (change.check) change.check(changed);
        PictureState state = *now;
        if (change.object) state.record.object = *change.object;
        if (change.source) state.record.source = *change.source;
        if (change.metadata) {
          state.record.metadata = MergeMetadata(state.record.metadata, *change.metadata);
        }
        if (state.record.object == now->record.object &&
            state.record.metadata == now->record.metadata &&
            state.record.source == now->record.source) {
          return;
        }
        state.record.updated_ms = NowMs();
        changed = RecordOf(state, in.name);
        commit.Put(std::move(state), now);
      },
      {{{collection, id}}, {}});
  return changed;
}

std::vector<PictureOutline> ClickhouseWriter::SelectNow(Change& change, const Selection& which) {
  return catalogue_.Select(change.snapshot(), which);
}

ObjectRecord ClickhouseWriter::ChangeObject(const std::string& collection,
                                            const std::string& object, const ObjectChange& change) {
  ObjectRecord changed;
  const auto work = [&](Change& commit) {
    const CollectionEntry in = commit.registry().Require(collection);
    Selection which;
    which.collection = collection;
    which.object = object;
    const std::vector<PictureOutline> pictures =
        object.empty() ? std::vector<PictureOutline>{} : SelectNow(commit, which);
    if (pictures.empty()) throw refusals::NoObject(object);
    changed = {object, pictures.size()};
    if (change.check) change.check(changed, FirstId(pictures));
    if (change.name == object) return;
    changed.object = change.name;
    which.object = change.name;
    const std::vector<PictureOutline> others = SelectNow(commit, which);
    if (!others.empty() && !change.merge) {
      throw refusals::ObjectExists(change.name, others.size());
    }
    for (const PictureOutline& picture : pictures) {
      const auto now = commit.Find(in.key, picture.id);
      PictureState state = now.value();
      state.record.object = change.name;
      // Another name of an object is no change of its pictures; to be of another object is.
      if (!others.empty()) state.record.updated_ms = NowMs();
      commit.Put(std::move(state), now);
    }
    changed.images += others.size();
  };
  commits_.Run(work, {}, /*alone=*/true);
  return changed;
}

bool ClickhouseWriter::Remove(const std::string& collection, const std::string& id,
                              const PictureCheck& check) {
  bool removed = false;
  commits_.Run(
      [&](Change& change) {
        const CollectionEntry in = change.registry().Require(collection);
        const auto now = change.Find(in.key, id);
        removed = now.has_value();
        if (!now) return;
        if (check) {
          const ImageRecord record = RecordOf(*now, in.name);
          check(&record);
        }
        change.Remove(*now);
      },
      {{{collection, id}}, {}});
  return removed;
}

std::uint64_t ClickhouseWriter::RemoveObject(const std::string& collection,
                                             const std::string& object, const ObjectCheck& check) {
  std::uint64_t removed = 0;
  const auto work = [&](Change& change) {
    removed = 0;
    const CollectionEntry in = change.registry().Require(collection);
    if (object.empty()) return;
    Selection which;
    which.collection = collection;
    which.object = object;
    const std::vector<PictureOutline> pictures = SelectNow(change, which);
    if (pictures.empty()) return;
    if (check) check({object, pictures.size()}, FirstId(pictures));
    for (const PictureOutline& picture : pictures) {
      if (const auto now = change.Find(in.key, picture.id)) change.Remove(*now);
    }
    removed = pictures.size();
  };
  commits_.Run(work, {}, /*alone=*/true);
  return removed;
}

std::uint64_t ClickhouseWriter::RemoveWhere(const Selection& which) {
  std::uint64_t removed = 0;
  const auto work = [&](Change& change) {
    const std::uint32_t in = change.registry().Require(which.collection).key;
    const std::vector<PictureOutline> pictures = SelectNow(change, which);
    for (const PictureOutline& picture : pictures) {
      PictureState now;
      now.version = picture.version;
      now.collection = in;
      now.picture = picture.picture;
      now.record.id = picture.id;
      now.record.sha256 = std::string(64, '0');
      change.Remove(now);
    }
    removed = pictures.size();
  };
  commits_.Run(work, {}, /*alone=*/true);
  return removed;
}

MoveOriginalsResult ClickhouseWriter::MoveOriginals(
    const std::filesystem::path& /*directory*/, const std::function<void(double)>& /*progress*/) {
  throw Error(ErrorCode::kInvalidArgument, "originals_in_cluster",
              "a cluster keeps the uploaded bytes itself; there is no directory of them");
}

}  // namespace pliant::clickhouse
