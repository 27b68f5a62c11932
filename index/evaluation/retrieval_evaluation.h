// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The retrieval benchmark of `pliant eval retrieval`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "descriptor/features/foreign_features.h"
#include "index/evaluation/retrieval_gallery.h"
#include "index/evaluation/retrieval_metrics.h"
#include "index/evaluation/retrieval_set.h"

namespace pliant {

enum class RetrievalProtocol {
  // The paper's (section 4.3): k-medoids of 10 000 descriptors drawn at random, k = 10; normalised
  // histograms; nearest by Euclidean distance.
  kPaper,
  kDefault,     // the defaults of `pliant index` and `pliant query`
  kUnverified,  // the default without verification (`pliant query --verify none`)
};
inline const std::vector<std::pair<std::string, RetrievalProtocol>> kRetrievalProtocols = {
    {"paper", RetrievalProtocol::kPaper},
    {"default", RetrievalProtocol::kDefault},
    {"unverified", RetrievalProtocol::kUnverified}};

struct RetrievalOptions {
  std::vector<std::string> descriptors = {"deal"};
  std::vector<FeatureSource> features;  // further rows
  DescriptorOptions descriptor_options;
  ExtractionOptions extraction = IndexExtraction();
  std::vector<RetrievalProtocol> protocols = {RetrievalProtocol::kPaper,
                                              RetrievalProtocol::kDefault};
  int seeds = 3;                 // vocabularies are trained with the seeds 1, 2, ...
  std::vector<int> words = {0};  // of kDefault and kUnverified, each in turn; 0 = the default's own
  int sample = 0;                // descriptors they are trained on; 0 = the default's own
  RankMethod rank = RankMethod::kNeighbours;  // of all protocols but the paper's
  std::size_t verify_depth = 0;               // as SearchOptions::verify_depth
  bool keep_answers = false;                  // in RetrievalResult::answers
  int jobs = 0;                               // threads that describe images; 0 = one per core
  // Folder for databases that keep the features for the next run; empty: nothing is kept.
  std::filesystem::path cache;
  // The current step and its progress; `total` 0 = unknown. Called from any thread.
  std::function<void(const std::string& what, std::size_t done, std::size_t total)> progress;
  std::stop_token stop;
};

struct RetrievalResult {
  std::string descriptor;
  std::string protocol;
  std::size_t words = 0;               // of the vocabulary; 0 = unknown
  RetrievalMetrics mean;               // over the seeds
  RetrievalMetrics spread;             // sample standard deviation over the seeds
  std::optional<double> ns_score;      // UKBench layout only
  std::optional<ObjectAnswer> object;  // first seed; absent if queries are also in the gallery
  std::size_t refused = 0;             // queries, which count as misses
  AbsentAnswers absent;                // first seed
  AbsentAnswers left_out;              // first seed: the queries without their object
  std::vector<NamedAnswer> answers;    // first seed, with RetrievalOptions::keep_answers
  RetrievalTimes times;                // first seed
  double stored_bytes_per_image = 0;
  double index_bytes_per_image = 0;
};

struct RetrievalReport {
  RetrievalLayout layout = RetrievalLayout::kObjects;
  std::size_t images = 0;  // searched, distractors included
  std::size_t distractors = 0;
  std::size_t queries = 0;
  std::size_t absent = 0;
  std::size_t objects = 0;
  int seeds = 0;
  std::vector<RetrievalResult> results;  // by descriptor, words, protocol
  std::vector<SkippedFile> skipped;
  double seconds = 0;
};

// Throws kInvalidArgument for options out of range, and what RetrievalGallery and MakeDescriptor
// throw.
RetrievalReport EvaluateRetrieval(const RetrievalSet& set, const RetrievalOptions& options);

}  // namespace pliant
