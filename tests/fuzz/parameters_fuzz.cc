// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Parameters of requests, and what else routes read of one. An input has a line for each thing:
// "?NAME=VALUE" in the query, "FILE NAME=VALUE" a form field (with the name of a file, which may be
// empty), ":NAME=VALUE" a header; what is behind an empty line is a JSON body.
#include "server/http/conditions.h"
#include "server/http/parameters.h"
#include "server/routes/lists.h"
#include "server/routes/request_body.h"
#include "tests/fuzz/refusal.h"

namespace {

using pliant::fuzz::Answers;
using pliant::fuzz::Require;
using pliant::server::Parameter;
using pliant::server::Parameters;
using pliant::server::Request;

const pliant::server::Route& TestRoute() {
  static const pliant::server::Route kRoute{
      .name = "test",
      .method = "POST",
      .pattern = "/test",
      .body = pliant::server::BodyKind::kImageOrJson,
      .parameters = {Parameter("whole", "").Integer(-5, 1000), Parameter("number", "").Number(0, 1),
                     Parameter("region", "").Numbers(4), Parameter("rank", "").Choice({"a", "b"}),
                     Parameter("on", "").Boolean(), Parameter("filter", "").Json(),
                     Parameter("items", "").JsonList(), Parameter("second", "").Image(),
                     Parameter("cursor", ""), Parameter("object", "")},
      .handler = [](const Request&, const Parameters&) { return pliant::server::Response(); }};
  return kRoute;
}

// Its line must outlive the request.
void AddLine(std::string_view line, Request& request) {
  const std::size_t equals = std::min(line.find('='), line.size());
  const std::string name(line.substr(0, equals));
  const std::string_view value = line.substr(std::min(equals + 1, line.size()));
  if (name.starts_with('?')) {
    request.query.emplace(name.substr(1), value);
  } else if (name.starts_with(':')) {
    request.headers.emplace(name.substr(1), value);
  } else {
    const std::size_t space = std::min(name.find(' '), name.size());
    request.content_type = "multipart/form-data";
    request.parts.push_back(
        {name.substr(std::min(space + 1, name.size())), name.substr(0, space), "", value});
  }
}

Request RequestOf(std::string_view text) {
  Request request;
  while (!text.empty()) {
    const std::string_view line = pliant::fuzz::TakeLine(text);
    if (line.empty()) break;
    AddLine(line, request);
  }
  if (text.empty()) return request;
  request.has_body = true;
  request.content_type = "application/json";
  request.body = text;
  return request;
}

void CheckValues(const Parameters& parameters) {
  const auto whole = parameters.Get<std::int64_t>("whole");
  Require(!whole || (*whole >= -5 && *whole <= 1000), "whole numbers are within their bounds");
  const auto number = parameters.Get<double>("number");
  Require(!number || (*number >= 0 && *number <= 1), "numbers are within their bounds");
  const auto region = parameters.Get<std::vector<double>>("region");
  Require(!region || region->size() == 4, "a region has four numbers");
  const auto rank = parameters.Choice<int>("rank", {{"a", 1}, {"b", 2}});
  Require(!rank || *rank == 1 || *rank == 2, "a choice is one of its values");
  Require(parameters.Get<bool>("on").has_value() == parameters.has("on"),
          "a flag is true or false");
  const auto filter = parameters.Text("filter");
  Require(!filter || filter->starts_with('{'), "an object is one");
  const auto items = parameters.Get<pliant::Json>("items");
  Require(!items || items->is_array(), "a list is one");
  const pliant::server::ImageText* second = parameters.Image("second");
  Require((second != nullptr) == parameters.has("second"), "an image is there or not");
  Require(second == nullptr || second->base64.has_value() != second->url.has_value(),
          "an image is base64 or an address");
  const auto object = parameters.Text("object");
  Require(!object || pliant::IsValidUtf8(*object), "text is UTF-8");
  Answers([&] {
    const std::string after = pliant::server::AfterFromCursor(parameters, "list");
    const auto cursor = parameters.Text("cursor");
    Require(!cursor || cursor->empty() || pliant::IsValidUtf8(after), "a cursor is text");
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Request request = RequestOf(pliant::fuzz::TextOf({data, size}));
  Answers([&] { CheckValues(Parameters(TestRoute(), request)); });
  Answers([&] {
    const Parameters parameters(TestRoute(), request);
    static pliant::server::Fetcher no_fetcher{{}};
    const std::string filename = pliant::server::ImageOf(request, parameters, no_fetcher).filename;
    Require(filename.find('/') == std::string::npos && pliant::IsValidUtf8(filename),
            "the name of a file is no path");
  });
  for (const auto& image : pliant::server::ImageParts(request)) {
    Require(pliant::IsValidUtf8(image.filename), "the file name of a part is text");
  }
  const bool unchanged = !pliant::server::NamedByIfNoneMatch(request, "\"0123\"").empty();
  Require(!unchanged || request.headers.contains("If-None-Match"), "who does not ask is answered");
  return 0;
}
