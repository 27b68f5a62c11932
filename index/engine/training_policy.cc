// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/training_policy.h"

namespace pliant {

namespace {

bool HasOutgrown(const CollectionRecord& record) {
  const VocabularyOrigin& origin = record.vocabulary->origin;
  if (origin.sampled < kFullSample) return record.descriptors >= kGrowth * origin.available;
  return DefaultVocabularySample(record.descriptors) >= kWordGrowth * origin.sampled;
}

}  // namespace

bool AutomaticTrainingIsDue(const CollectionRecord& record) {
  if (record.descriptors == 0) return false;
  return !record.vocabulary || (record.automatic && HasOutgrown(record));
}

}  // namespace pliant
