// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Paths of requests, and which route they are for.
#include "server/http/parameters.h"
#include "server/http/router.h"
#include "tests/fuzz/refusal.h"

namespace {

using pliant::fuzz::Answers;
using pliant::fuzz::Require;
using pliant::server::Request;
using pliant::server::Response;
using pliant::server::Router;

const Router& TestRouter() {
  const auto handler = [](const Request&, const pliant::server::Parameters&) { return Response(); };
  static const Router kRouter(
      {{.name = "a", .method = "GET", .pattern = "/x", .handler = handler},
       {.name = "b", .method = "POST", .pattern = "/x/{id}", .handler = handler},
       {.name = "c", .method = "GET", .pattern = "/x/{id}/y/{z}", .handler = handler}});
  return kRouter;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view path = pliant::fuzz::TextOf({data, size});
  Request request;
  if (!Answers([&] { request.segments = pliant::server::SplitPath(path); })) return 0;
  std::string again;
  for (const std::string& segment : request.segments) {
    Require(pliant::IsValidUtf8(segment), "a segment is UTF-8");
    again += "/" + pliant::server::EncodeSegment(segment);
  }
  Require(pliant::server::SplitPath(again) == request.segments, "a path can be written again");
  for (const char* method : {"GET", "POST", "DELETE"}) {
    request.method = method;
    Answers([&] {
      const pliant::server::Route& route = TestRouter().Resolve(request);
      Require(route.method == method, "a route has the request's method");
      for (const auto& [name, value] : request.captures) {
        Require(!value.empty(), "what is captured is not empty");
      }
    });
  }
  return 0;
}
