// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Filters on metadata. An input is a filter's JSON on the first line, and metadata behind it.
#include "index/files/names.h"
#include "index/records/filter.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Accepts;
  using pliant::fuzz::Require;
  std::string_view text = pliant::fuzz::TextOf({data, size});
  const std::string json(pliant::fuzz::TakeLine(text));
  const std::string metadata(text);
  pliant::Filter filter;
  if (!Accepts([&] { filter = pliant::ParseFilter(json); })) return 0;
  Require(Accepts([&] { pliant::CheckFilter(filter); }), "a filter that is read is valid");
  const bool passes = pliant::Passes(filter, metadata);
  std::string canonical;
  if (Accepts([&] { canonical = pliant::CanonicalMetadata(metadata); })) {
    Require(pliant::Passes(filter, canonical) == passes, "metadata pass as they are stored");
  }
  for (const pliant::FilterCondition& condition : filter.conditions) {
    pliant::Filter one;
    one.conditions.push_back(condition);
    Require(!passes || pliant::Passes(one, metadata), "all conditions hold");
  }
  for (const pliant::Filter& part : filter.all_of) {
    Require(!passes || pliant::Passes(part, metadata), "all parts hold");
  }
  for (const pliant::Filter& part : filter.none_of) {
    Require(!passes || !pliant::Passes(part, metadata), "no part of a not holds");
  }
  // Of what is JSON, either passes; of what is none, neither.
  if (canonical.empty() || filter.empty()) return 0;
  const pliant::Filter opposite{.none_of = {filter}};
  Require(pliant::Passes(opposite, metadata) != passes, "not is the opposite");
  Require(pliant::Passes(pliant::Filter{.any_of = {{filter, opposite}}}, metadata),
          "one of the two holds");
  Require(!pliant::Passes(pliant::Filter{.all_of = {filter, opposite}}, metadata), "never both");
  return 0;
}
