// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: training vocabularies, quantising, switching.
#include <algorithm>

#include "descriptor/base/error.h"
#include "index/engine/engine_core.h"
#include "index/engine/training_policy.h"

namespace pliant {
namespace {

constexpr double kTrainingShare = 0.8;  // of the progress; the rest is quantising

void Validate(const TrainOptions& options) {
  const auto fail = [](const std::string& field, const std::string& message) {
    throw Error(ErrorCode::kInvalidArgument, field + "_invalid", field + " " + message);
  };
  if (options.words < 0 || options.words > static_cast<int>(kMaxWords)) {
    fail("words", "must be 0 to " + std::to_string(kMaxWords) + ".");
  }
  if (options.sample < 0 || options.sample > static_cast<int>(kMaxVocabularySamples)) {
    fail("sample", "must be 0 to " + std::to_string(kMaxVocabularySamples) + ".");
  }
  if (options.threads < 0) fail("threads", "must not be negative.");
}

// Ten a word, and 10 000 at least, when the words are given.
std::size_t ChooseSample(const TrainOptions& options, std::uint64_t descriptors) {
  constexpr int kLeast = 10'000;
  if (options.sample > 0) return static_cast<std::size_t>(options.sample);
  if (options.words == 0) return DefaultVocabularySample(descriptors);
  return static_cast<std::size_t>(std::max(kLeast, 10 * options.words));
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
    throw Error(ErrorCode::kConflict, "no_images",
                "Collection \"" + options.collection +
                    "\" has no images to train a vocabulary from. Add images first.");
  }
  const std::size_t tenth = std::max<std::size_t>(1, sample.descriptors.rows / 10);
  const int words = options.words > 0 ? options.words : static_cast<int>(tenth);
  if (static_cast<std::size_t>(words) > sample.descriptors.rows) {
    throw Error(ErrorCode::kInvalidArgument, "words_invalid",
                "words must be at most the number of sampled descriptors, " +
                    std::to_string(sample.descriptors.rows) + " of " +
                    std::to_string(sample.available) + ". It is " + std::to_string(words) + ".");
  }
  return words;
}

// Runs `work`. When it fails because the collection was removed meanwhile, with all that belongs to
// it, the error is "collection_not_found", also when there is another one of that name now.
template <typename Work>
auto OnCollection(Catalogue& catalogue, const CollectionState& collection, Work work) {
  try {
    return work();
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kCancelled ||
        catalogue.RequireCollection(collection.name).key == collection.key) {
      throw;
    }
  }
  throw Error(ErrorCode::kNotFound, "collection_not_found",
              "The collection " + collection.name + " was deleted during the work.");
}

// Gives words of `vocabulary` to all images that lack them. `progress` hears of the share done.
void QuantizeMissing(EngineCore& core, Key collection, Key vocabulary, const Quantizer& quantizer,
                     int threads, const std::stop_token& stop,
                     const std::function<void(double)>& progress) {
  const auto total = static_cast<double>(core.catalogue().CountImages(collection));
  core.writer().Quantize(collection, vocabulary, quantizer, threads, [&](std::uint64_t done) {
    ThrowIfStopped(stop);
    progress(std::min(1.0, static_cast<double>(done) / std::max(total, 1.0)));
  });
}

// Runs while another error is on its way out, which must not be covered by a second one: what
// cannot be removed now is left to the next AddVocabulary, which removes what was abandoned.
void DropUnfinished(EngineCore& core, Key vocabulary) noexcept {
  try {
    core.writer().DropVocabulary(vocabulary);
  } catch (const std::exception&) {
    return;
  }
}

VocabularyRecord StoreVocabulary(EngineCore& core, const CollectionState& collection,
                                 const std::shared_ptr<const Vocabulary>& vocabulary,
                                 const TrainOptions& options) {
  Key key = 0;
  try {
    key = core.writer().AddVocabulary(collection.key, *vocabulary);
    const Quantizer quantizer(vocabulary);
    QuantizeMissing(
        core, collection.key, key, quantizer, options.threads, options.stop, [&](double share) {
          if (!options.progress) return;
          options.progress(kTrainingShare + (1 - kTrainingShare) * share, vocabulary->origin.loss);
        });
    const bool is_first = core.catalogue().RequireCollection(options.collection).vocabulary == 0;
    const auto prepared = is_first ? core.ranker().Prepare(collection.key, key) : nullptr;
    return core.writer().FinishVocabulary(options.collection, key, quantizer, options.automatic);
  } catch (...) {
    if (key != 0) DropUnfinished(core, key);
    throw;
  }
}

}  // namespace

VocabularyRecord Engine::TrainVocabulary(const TrainOptions& options) {
  Validate(options);
  const std::lock_guard lock(training_mutex_);
  const CollectionState collection = core_->catalogue().RequireCollection(options.collection);
  const std::uint64_t descriptors =
      core_->catalogue().DescribeCollection(options.collection).descriptors;
  const DescriptorSample sample = core_->catalogue().SampleDescriptors(
      collection.key, ChooseSample(options, descriptors), options.seed);
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
      sample.descriptors, core_->model().model_id, sample.available, k_medoids));
  ThrowIfStopped(options.stop);

  return OnCollection(core_->catalogue(), collection,
                      [&] { return StoreVocabulary(*core_, collection, vocabulary, options); });
}

void Engine::UseVocabulary(const std::string& collection_name, std::int64_t id,
                           const UseOptions& options) {
  const CollectionState collection = core_->catalogue().RequireCollection(collection_name);
  const auto record = core_->catalogue().FindVocabulary(collection_name, id);
  if (!record) {
    throw Error(ErrorCode::kNotFound, "vocabulary_not_found",
                "No vocabulary has the number " + std::to_string(id) + " in collection \"" +
                    collection_name + "\".");
  }
  const std::string& model_id = core_->model().model_id;
  if (record->model_id != model_id) {
    throw Error(ErrorCode::kConflict, "model_mismatch",
                "Vocabulary " + std::to_string(id) + " was trained for " + record->model_id +
                    ", but the database uses " + model_id + ". Train a new vocabulary.");
  }
  OnCollection(core_->catalogue(), collection, [&] {
    const Quantizer quantizer(core_->catalogue().ReadVocabulary(id));
    QuantizeMissing(*core_, collection.key, id, quantizer, options.threads, options.stop,
                    [&](double share) {
                      if (options.progress) options.progress(share);
                    });
    const auto prepared = record->active ? nullptr : core_->ranker().Prepare(collection.key, id);
    core_->writer().SetActiveVocabulary(collection_name, id, quantizer, options.automatic);
  });
}

std::vector<VocabularyRecord> Engine::ListVocabularies(const std::string& collection) {
  return core_->catalogue().ListVocabularies(collection);
}

std::uint64_t Engine::CountUnquantized(const std::string& collection, std::int64_t id) {
  return core_->catalogue().CountUnquantized(collection, id);
}

}  // namespace pliant
