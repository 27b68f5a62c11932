// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: whether two pictures show the same object.
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/stopwatch.h"
#include "index/engine/engine_impl.h"
#include "index/store/feature_codec.h"
#include "index/verify/explain.h"
#include "index/verify/verification.h"

namespace pliant {
namespace {

ComparedPicture Checked(const Features& features, const char* which) {
  const std::size_t keypoints = features.keypoints.size();
  if (keypoints < kMinKeypoints) {
    throw Error(ErrorCode::kUnprocessable, "too_few_features",
                std::string("the ") + which + " picture has " + std::to_string(keypoints) +
                    " key points, " + std::to_string(kMinKeypoints) + " are the least");
  }
  return {features.width, features.height, static_cast<std::uint32_t>(keypoints)};
}

void AddUp(const ExtractionTimings& one, ExtractionTimings* sum) {
  sum->decode_ms += one.decode_ms;
  sum->detect_ms += one.detect_ms;
  sum->describe_ms += one.describe_ms;
}

// What the features of both say; adds to verify_ms.
void Conclude(const Features& query, const Features& reference, int threads,
              Comparison* comparison) {
  const Stopwatch watch;
  const VerificationResult result = Verifier(query, {.threads = threads}).Verify(reference);
  comparison->verify_ms += watch.ms();
  comparison->explanation = Explain(query, reference, result);
  comparison->explanation.ranking_score = kNoResemblance;
  comparison->outline.clear();
  for (const Vec2 p : result.outline) comparison->outline.push_back({p.x, p.y});
  const double evidence = Evidence(result.independent, InliersByChance(query.keypoints.size()));
  comparison->probability = Probability(LiftScore(kNoResemblance, evidence));
}

}  // namespace

Comparison Engine::Impl::Compare(Bytes first, Bytes second, int threads) {
  Comparison comparison;
  // Each as a search would have it: the first as what is stored, the second as what is asked.
  const auto describe = [&](const FeatureExtractor& extract, Bytes bytes, const char* which,
                            ComparedPicture* picture) {
    ExtractionTimings timings;
    Features features = extract.Extract(bytes, threads, &timings);
    *picture = Checked(features, which);
    AddUp(timings, &comparison.timings);
    return features;
  };
  const Features reference =
      InStoredPrecision(describe(extractor(), first, "first", &comparison.first));
  const Features query = describe(query_extractor(), second, "second", &comparison.second);
  Conclude(InStoredPrecision(query), reference, threads, &comparison);
  if (comparison.found()) return comparison;
  auto closer = query_extractor().LookCloser(second, query, {}, threads, &comparison.timings);
  if (!closer) return comparison;
  Comparison at_second_sight = comparison;
  at_second_sight.second = Checked(*closer, "second");
  Conclude(InStoredPrecision(*std::move(closer)), reference, threads, &at_second_sight);
  comparison.verify_ms = at_second_sight.verify_ms;
  return at_second_sight.probability > comparison.probability ? at_second_sight : comparison;
}

}  // namespace pliant
