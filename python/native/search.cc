// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Searches of an index. The answer is the JSON text that `pliant query` prints.
#include <array>
#include <chrono>
#include <optional>

#include "index/json/result_json.h"
#include "index/records/filter.h"
#include "python/native/convert.h"
#include "python/native/open_index.h"

namespace pliant::python {
namespace {

template <typename Value, std::size_t count>
Value Named(const char* field, const std::string& given,
            const std::array<std::pair<const char*, Value>, count>& names) {
  std::string known;
  for (const auto& [name, value] : names) {
    if (given == name) return value;
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  throw Error(ErrorCode::kInvalidArgument, std::string(field) + "_invalid",
              std::string(field) + " must be one of " + known);
}

// Fields of SearchOptions by their names in the HTTP interface; the Python side passes no others.
SearchOptions ToOptions(const py::dict& given, const std::string& collection) {
  SearchOptions options;
  options.collection = collection;
  options.limit = given["top"].cast<std::size_t>();
  options.offset = given["offset"].cast<std::size_t>();
  options.rank = Named("rank", given["rank"].cast<std::string>(),
                       std::array{std::pair{"neighbours", RankMethod::kNeighbours},
                                  std::pair{"histogram", RankMethod::kHistogram}});
  options.group_by =
      Named("group_by", given["group_by"].cast<std::string>(),
            std::array{std::pair{"object", GroupBy::kObject}, std::pair{"image", GroupBy::kImage}});
  options.verify =
      Named("verify", given["verify"].cast<std::string>(),
            std::array{std::pair{"auto", Verification::kAuto}, std::pair{"tps", Verification::kTps},
                       std::pair{"none", Verification::kNone}});
  options.verify_depth = given["verify_depth"].cast<std::size_t>();
  options.expand = given["expand"].cast<std::optional<int>>();
  options.max_instances = given["instances"].cast<int>();
  options.second_pass = given["closer_look"].cast<bool>();
  if (const auto region = given["region"].cast<std::optional<std::array<double, 4>>>()) {
    options.region = Region{(*region)[0], (*region)[1], (*region)[2], (*region)[3]};
  }
  options.min_score = given["min_score"].cast<double>();
  options.object = given["object"].cast<std::optional<std::string>>();
  const auto filter = given["filter"].cast<std::string>();
  if (!filter.empty()) options.filter = ParseFilter(filter);
  options.explain = given["explain"].cast<bool>();
  options.threads = given["threads"].cast<int>();
  return options;
}

template <typename Ask>
std::string Answer(const OpenIndex& index, const py::dict& given, Ask ask) {
  const SearchOptions options = ToOptions(given, index.collection());
  return index.Call([&](Engine& engine, const std::string&) {
    const auto start = std::chrono::steady_clock::now();
    const SearchResult result = ask(engine, options);
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    return ToText(SearchResultJson(result, took.count()));
  });
}

}  // namespace

void BindSearch(py::class_<OpenIndex>& index) {
  index.def("search", [](const OpenIndex& self, const py::bytes& data, const py::dict& options) {
    const Bytes bytes = ViewOf(data);
    return Answer(self, options, [bytes](Engine& engine, const SearchOptions& search) {
      return engine.Search(bytes, search);
    });
  });
  index.def("search_stored",
            [](const OpenIndex& self, const std::string& id, const py::dict& options) {
              return Answer(self, options, [&id](Engine& engine, const SearchOptions& search) {
                return engine.SearchStored(id, search);
              });
            });
  index.def("search_features", [](const OpenIndex& self, const py::object& given,
                                  const py::dict& options) {
    const Features features = ToFeatures(given, "features");
    return Answer(self, options, [&features](Engine& engine, const SearchOptions& search) {
      return engine.SearchFeatures(features, search);
    });
  });
}

}  // namespace pliant::python
