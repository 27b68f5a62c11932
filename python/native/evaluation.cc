// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "descriptor/base/error.h"
#include "index/evaluation/results_json.h"
#include "python/native/bindings.h"
#include "python/native/interruptible.h"

namespace pliant::python {
namespace {

// `describe` must outlive it. What it raises passes through the benchmark to the caller.
FeatureSource Source(const std::string& label, const py::function& describe) {
  return {label, [&describe](const std::filesystem::path& image) {
            const py::gil_scoped_acquire gil;
            return ToFeatures(describe(py::bytes(image.string())), "features");
          }};
}

std::string EvaluateMatching(const std::string& folder, const std::string& label,
                             const py::function& describe,
                             const std::vector<std::string>& descriptors, const std::string& model,
                             int pairs, int max_keypoints, std::uint64_t seed, int jobs) {
  std::stop_source stop;
  const Callback none(py::none(), stop);
  evaluation::MatchingOptions options;
  for (const std::string& name : descriptors)
    options.descriptors.push_back(evaluation::ParseDescriptorChoice(name));
  options.features.push_back(Source(label, describe));
  options.model = model;
  options.pairs = pairs;
  options.max_keypoints = max_keypoints;
  options.seed = seed;
  options.jobs = jobs;
  options.progress = [&stop](std::uint64_t, std::uint64_t) { return !stop.stop_requested(); };
  return ToText(Interruptibly(stop, none, [&] {
    return ResultsJson(
        evaluation::RunMatchingBenchmark(evaluation::OpenDataset(folder), options).results);
  }));
}

std::string EvaluateRetrievalOf(const std::string& folder, const std::string& label,
                                const py::function& describe,
                                const std::vector<std::string>& descriptors,
                                const std::string& model, const std::vector<std::string>& protocols,
                                int seeds, int jobs) {
  std::stop_source stop;
  const Callback none(py::none(), stop);
  RetrievalOptions options;
  options.descriptors = descriptors;
  options.descriptor_options.model_path = model;
  options.features.push_back(Source(label, describe));
  options.protocols.clear();
  for (const std::string& name : protocols) {
    const auto known = std::ranges::find(kRetrievalProtocols, name,
                                         &std::pair<std::string, RetrievalProtocol>::first);
    if (known == kRetrievalProtocols.end()) {
      throw Error(ErrorCode::kInvalidArgument, "protocols_invalid",
                  "there is no protocol '" + name + "'");
    }
    options.protocols.push_back(known->second);
  }
  options.seeds = seeds;
  options.jobs = jobs;
  options.stop = stop.get_token();
  return ToText(Interruptibly(stop, none, [&] {
    Json rows = Json::array();
    const RetrievalSet set = ReadRetrievalSet(folder, RetrievalLayout::kAuto);
    for (const RetrievalResult& row : EvaluateRetrieval(set, options).results)
      rows.push_back(ResultJson(row));
    return rows;
  }));
}

}  // namespace

void BindEvaluation(py::module_& module) {
  module.def("evaluate_matching", &EvaluateMatching);
  module.def("evaluate_retrieval", &EvaluateRetrievalOf);
}

}  // namespace pliant::python
