// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JSON bodies and parameters of requests.
#include "server/http/json.h"
#include "tests/fuzz/refusal.h"

namespace {

using pliant::Json;
using pliant::fuzz::Require;

int DepthOf(const Json& json) {
  int depth = 0;
  for (const Json& entry : json)
    depth = std::max(depth, entry.is_structured() ? DepthOf(entry) : 0);
  return depth + 1;
}

void CheckJson(const Json& json, Json::value_t top) {
  Require(DepthOf(json) <= pliant::server::kMaxJsonDepth, "no document is too deep");
  const std::string text = pliant::ToText(json);
  Require(pliant::IsValidUtf8(text), "JSON is UTF-8");
  Json again;
  Require(pliant::fuzz::Answers([&] { again = pliant::server::ParseJson(text, "body", top); }),
          "what is written can be read");
  Require(pliant::ToText(again) == text, "what is written has one form");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(pliant::fuzz::TextOf({data, size}));
  for (const auto top : {Json::value_t::object, Json::value_t::array}) {
    Json json;
    if (pliant::fuzz::Answers([&] { json = pliant::server::ParseJson(text, "body", top); })) {
      CheckJson(json, top);
    }
  }
  return 0;
}
