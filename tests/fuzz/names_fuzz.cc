// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// UTF-8, and the names of images, objects, collections and files.
#include <algorithm>

#include <nlohmann/json.hpp>

#include "index/files/names.h"
#include "index/files/text.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Accepts;
using pliant::fuzz::Require;

bool HasControl(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](unsigned char c) { return c < ' ' || c == 0x7F; });
}

// By another program.
bool IsUtf8(const std::string& text) {
  try {
    return !nlohmann::json(text).dump().empty();
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(pliant::fuzz::TextOf({data, size}));
  const bool valid = pliant::IsValidUtf8(text);
  Require(valid == IsUtf8(text), "UTF-8 is what others take for it");
  const std::string display = pliant::ToDisplayText(text);
  Require(pliant::IsValidUtf8(display) && !HasControl(display), "what is displayed is harmless");
  const bool escaped = display.find("\\u{") != std::string::npos;
  Require(display == text || !valid || HasControl(text) || escaped,
          "harmless text is displayed as it is");
  Require(display.size() > 4096 || Accepts([&] { pliant::CheckSource(display); }),
          "what is displayed may be a source");
  const std::string encoded = pliant::PercentEncode(text, "-._~");
  Require(std::all_of(encoded.begin(), encoded.end(),
                      [](char c) { return c > ' ' && c < 0x7F && c != '/'; }),
          "an encoded name is a part of an address");
  const bool harmless = valid && !HasControl(text);
  Require(!Accepts([&] { pliant::CheckImageId(text); }) || (harmless && !text.empty()),
          "an id is text");
  Require(!Accepts([&] { pliant::CheckCollectionName(text); }) || (harmless && !text.empty()),
          "a collection's name is text");
  Require(!Accepts([&] { pliant::CheckObject(text); }) || (harmless && text.size() <= 512),
          "an object's name is text");
  Require(!Accepts([&] { pliant::CheckSource(text); }) || (harmless && text.size() <= 4096),
          "a source is text");
  return 0;
}
