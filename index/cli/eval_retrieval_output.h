// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The retrieval report as text, JSON and CSV; results of other programs in the same JSON form.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "index/evaluation/retrieval_evaluation.h"
#include "index/json/json.h"

namespace pliant::cli {

// Accuracy and times, a row for each descriptor and protocol.
std::string RetrievalReportText(const RetrievalReport& report);

// One document: {"layout", "pictures", "distractors", "queries", "objects", "seeds", "results":
// [{"descriptor", "protocol", "words", "accuracy_at": [20], "map", "top1", "mrr", "ns_score",
// "object_top1", "object_mrr", "spread": {...}, "seconds_per_query", "milliseconds": {...},
// "bytes_per_picture": {...}}], "skipped": [{"file", "reason", "code"}], "seconds"}.
Json RetrievalReportJson(const RetrievalReport& report);

// A row for each descriptor and protocol: figures, then accuracy_at_1 .. accuracy_at_20.
std::string RetrievalReportCsv(const RetrievalReport& report);

// A row for each query and hit (ten at most; a query without hits has one row with empty fields):
// descriptor, protocol, words, query, object, rank, hit, hit_object, right, score, probability,
// inliers. With the answers that RetrievalOptions::keep_answers keeps.
std::string RetrievalAnswersCsv(const RetrievalReport& report);

// The set to be measured, for scripts that run other programs on it: {"layout", "counts_itself",
// "pictures": [{"file", "object" or null, "query", "searched"}]}.
Json RetrievalSetJson(const RetrievalSet& set);

// Adds the results in a file of the form above (written by the scripts of tests/accuracy for other
// programs). Throws kNotFound, kUnprocessable "peers_invalid" for a file that is not of that form,
// and kConflict "peers_differ" when they were measured with other numbers of pictures or queries.
void AddPeers(const std::filesystem::path& file, RetrievalReport* report);

}  // namespace pliant::cli
