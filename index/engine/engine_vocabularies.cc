// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: training, quantising and switching vocabularies.
#include <algorithm>
#include <span>

#include "descriptor/base/error.h"
#include "index/engine/engine_impl.h"
#include "index/store/blob_codec.h"
#include "index/store/sqlite/catalogue_vocabularies.h"
#include "index/store/sqlite/descriptor_sample.h"

namespace pliant {
namespace {

constexpr int kPicturesABatch = 64;
constexpr double kTrainingShare = 0.8;  // of the progress; the rest is quantising

void Validate(const TrainOptions& options) {
  const auto fail = [](const std::string& field, const std::string& message) {
    throw Error(ErrorCode::kInvalidArgument, field + "_invalid", field + " " + message);
  };
  if (options.words < 0 || options.words > static_cast<int>(kMaxWords)) {
    fail("words", "must be 0 to " + std::to_string(kMaxWords));
  }
  if (options.sample < 0 || options.sample > static_cast<int>(kMaxVocabularySamples)) {
    fail("sample", "must be 0 to " + std::to_string(kMaxVocabularySamples));
  }
  if (options.threads < 0) fail("threads", "must not be negative");
}

// For 4000 words where there are descriptors enough; ten a word, and 10 000 at least, when the
// words are given.
std::size_t ChooseSample(const TrainOptions& options) {
  constexpr int kDefault = 40'000;
  constexpr int kLeast = 10'000;
  if (options.sample > 0) return static_cast<std::size_t>(options.sample);
  if (options.words == 0) return kDefault;
  return static_cast<std::size_t>(std::max(kLeast, 10 * options.words));
}

struct PictureDescriptors {
  Key picture = 0;
  Descriptors descriptors;
};

// One product for a whole batch instead of one for each picture.
std::vector<Bow> AssignBatch(const Quantizer& quantizer,
                             const std::vector<PictureDescriptors>& batch, int threads) {
  Descriptors all;
  all.kind = quantizer.vocabulary().words.kind;
  all.dim = quantizer.vocabulary().words.dim;
  for (const PictureDescriptors& p : batch) {
    all.rows += p.descriptors.rows;
    all.floats.insert(all.floats.end(), p.descriptors.floats.begin(), p.descriptors.floats.end());
    all.bytes.insert(all.bytes.end(), p.descriptors.bytes.begin(), p.descriptors.bytes.end());
  }
  const std::vector<std::uint32_t> words = quantizer.Assign(all, threads);
  std::vector<Bow> bows;
  std::size_t first = 0;
  for (const PictureDescriptors& p : batch) {
    bows.push_back(
        quantizer.BowOf(all, first, std::span(words).subspan(first, p.descriptors.rows)));
    first += p.descriptors.rows;
  }
  return bows;
}

std::vector<PictureDescriptors> ReadBatch(Connection& db, const std::vector<Key>& keys) {
  std::vector<PictureDescriptors> batch;
  for (const Key key : keys) {
    batch.push_back({key, DecodeFeatures(ReadFeaturesBlob(db, key)).descriptors});
  }
  return batch;
}

void ThrowIfStopped(const std::stop_token& stop) {
  if (stop.stop_requested()) {
    throw Error(ErrorCode::kCancelled, "training_cancelled",
                "the training was stopped; the vocabularies are as they were");
  }
}

// As many as asked for, or a tenth of the sample. Throws where the sample cannot give them.
int ChooseWords(const TrainOptions& options, const DescriptorSample& sample) {
  if (sample.available == 0) {
    throw Error(ErrorCode::kConflict, "no_pictures",
                "there are no pictures in collection \"" + options.collection +
                    "\" to train a vocabulary from; add some first");
  }
  const std::size_t tenth = std::max<std::size_t>(1, sample.descriptors.rows / 10);
  const int words = options.words > 0 ? options.words : static_cast<int>(tenth);
  if (static_cast<std::size_t>(words) > sample.descriptors.rows) {
    throw Error(
        ErrorCode::kInvalidArgument, "words_invalid",
        "words must be at most the number of sampled descriptors: " + std::to_string(words) +
            " asked for, " + std::to_string(sample.descriptors.rows) + " sampled of " +
            std::to_string(sample.available));
  }
  return words;
}

}  // namespace

VocabularyRecord Engine::Impl::TrainVocabulary(const TrainOptions& options) {
  Validate(options);
  const std::lock_guard lock(training_mutex_);
  CollectionRow collection;
  const DescriptorSample sample = Read([&](Connection& db) {
    collection = RequireCollection(db, options.collection);
    return SampleDescriptors(db, collection, model_.info, ChooseSample(options), options.seed);
  });
  KMedoidsOptions k_medoids;
  k_medoids.k = ChooseWords(options, sample);
  k_medoids.seed = options.seed;
  k_medoids.threads = options.threads;
  k_medoids.stop = options.stop;
  if (options.progress) {
    k_medoids.progress = [&](double done, double loss) {
      options.progress(kTrainingShare * done, loss);
    };
  }
  const auto vocabulary = std::make_shared<const Vocabulary>(pliant::TrainVocabulary(
      sample.descriptors, model_.info.model_id, sample.available, k_medoids));
  ThrowIfStopped(options.stop);

  Key key = 0;
  Write([&](Connection& db) {
    DeleteAbandonedVocabularies(db, collection.key);
    key = InsertVocabulary(db, collection.key, model_.key, *vocabulary);
  });
  try {
    const Quantizer quantizer(vocabulary);
    QuantizeMissing(
        collection.key, key, quantizer, options.threads, options.stop, [&](double share) {
          if (!options.progress) return;
          options.progress(kTrainingShare + (1 - kTrainingShare) * share, vocabulary->origin.loss);
        });
    std::optional<VocabularyRecord> record;
    Write([&](Connection& db) {
      QuantizeRest(db, collection.key, key, quantizer);
      MarkVocabularyReady(db, key);
      CollectionRow now = RequireCollection(db, options.collection);
      if (now.active_vocabulary == 0) {
        SetActiveVocabulary(db, now.key, key, options.automatic);
        now.active_vocabulary = key;
      }
      record = FindVocabulary(db, now, key);
    });
    return record.value();
  } catch (...) {
    DropUnfinished(key);
    throw;
  }
}

// Runs while another error is on its way out, which must not be covered by a second one: what
// cannot be removed now is left to DeleteAbandonedVocabularies.
void Engine::Impl::DropUnfinished(Key vocabulary) noexcept {
  try {
    Write([&](Connection& db) { DeleteVocabulary(db, vocabulary); }, true);
  } catch (const std::exception&) {
    return;
  }
}

void Engine::Impl::QuantizeMissing(Key collection, Key vocabulary, const Quantizer& quantizer,
                                   int threads, const std::stop_token& stop,
                                   const std::function<void(double)>& progress) {
  const auto total = static_cast<double>(Read([&](Connection& db) {
    return db.Prepare("SELECT count(*) FROM pictures WHERE collection = ?")
        .Bind(collection)
        .One()
        .Int(0);
  }));
  double done = 0;
  Key after = 0;
  while (true) {
    ThrowIfStopped(stop);
    const std::vector<PictureDescriptors> batch = Read([&](Connection& db) {
      return ReadBatch(db,
                       PicturesWithoutWords(db, collection, vocabulary, after, kPicturesABatch));
    });
    if (batch.empty()) return;
    const std::vector<Bow> bows = AssignBatch(quantizer, batch, threads);
    Write([&](Connection& db) {
      for (std::size_t i = 0; i < batch.size(); ++i) {
        InsertPictureWords(db, vocabulary, batch[i].picture, bows[i]);
      }
    });
    after = batch.back().picture;
    done += static_cast<double>(batch.size());
    progress(std::min(1.0, done / std::max(total, 1.0)));
  }
}

// What was added while QuantizeMissing ran; inside the writer's transaction.
void Engine::Impl::QuantizeRest(Connection& db, Key collection, Key vocabulary,
                                const Quantizer& quantizer) {
  while (true) {
    const std::vector<Key> keys =
        PicturesWithoutWords(db, collection, vocabulary, 0, kPicturesABatch);
    if (keys.empty()) return;
    const std::vector<PictureDescriptors> batch = ReadBatch(db, keys);
    const std::vector<Bow> bows = AssignBatch(quantizer, batch, 0);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      InsertPictureWords(db, vocabulary, batch[i].picture, bows[i]);
    }
  }
}

void Engine::Impl::UseVocabulary(const std::string& collection_name, std::int64_t id,
                                 const UseOptions& options) {
  CollectionRow collection;
  const auto vocabulary = Read([&](Connection& db) {
    collection = RequireCollection(db, collection_name);
    const auto record = FindVocabulary(db, collection, id);
    if (!record) {
      throw Error(ErrorCode::kNotFound, "vocabulary_not_found",
                  "there is no vocabulary " + std::to_string(id) + " in collection \"" +
                      collection_name + "\"");
    }
    if (record->model_id != model_.info.model_id) {
      throw Error(ErrorCode::kConflict, "model_mismatch",
                  "vocabulary " + std::to_string(id) + " was made for " + record->model_id +
                      ", the database holds " + model_.info.model_id);
    }
    return ReadVocabulary(db, id);
  });
  const Quantizer quantizer(vocabulary);
  QuantizeMissing(collection.key, id, quantizer, options.threads, options.stop, [&](double share) {
    if (options.progress) options.progress(share);
  });
  Write([&](Connection& db) {
    const CollectionRow now = RequireCollection(db, collection_name);
    if (options.automatic && now.active_vocabulary != 0 && !now.automatic) return;
    QuantizeRest(db, collection.key, id, quantizer);
    SetActiveVocabulary(db, collection.key, id, options.automatic);
  });
}

}  // namespace pliant
