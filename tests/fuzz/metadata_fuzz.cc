// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Metadata of images: any JSON object, rewritten in one form.
#include "index/files/names.h"
#include "index/files/text.h"
#include "index/json/json.h"
#include "index/json/record_json.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Accepts;
  using pliant::fuzz::Require;
  const std::string text(pliant::fuzz::TextOf({data, size}));
  const std::string shown = pliant::ToText(pliant::MetadataJson(text));
  Require(pliant::IsValidUtf8(shown), "what is shown is UTF-8");
  std::string canonical;
  if (!Accepts([&] { canonical = pliant::CanonicalMetadata(text); })) return 0;
  Require(pliant::CanonicalMetadata(canonical) == canonical, "metadata have one form");
  Require(pliant::MetadataJson(canonical).is_object() &&
              pliant::ToText(pliant::MetadataJson(canonical)) == canonical,
          "what is stored is shown as it is");
  return 0;
}
