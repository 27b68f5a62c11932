// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Forms and queries. The first line of an input is the Content-Type and the query; the body
// follows.
#include "server/http/form.h"
#include "tests/fuzz/refusal.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Require;
  constexpr std::size_t kMostParts = 4;
  std::string_view body = pliant::fuzz::TextOf({data, size});
  const std::string_view type = pliant::fuzz::TakeLine(body);
  pliant::fuzz::Answers([&] {
    const auto parts = pliant::server::ParseForm(type, body, kMostParts);
    Require(!parts.empty() && parts.size() <= kMostParts, "a form has a few parts");
    const char* at = body.data();
    for (const pliant::server::Part& part : parts) {
      Require(!part.name.empty(), "a part has a name");
      Require(part.content.data() >= at, "parts follow each other");
      at = part.content.data() + part.content.size();
      Require(at <= body.data() + body.size(), "a part is inside the body");
    }
  });
  std::size_t bytes = 0;
  for (const auto& [name, value] : pliant::server::ParseQuery(type))
    bytes += name.size() + value.size();
  Require(bytes <= type.size(), "decoded text is not longer");
  return 0;
}
