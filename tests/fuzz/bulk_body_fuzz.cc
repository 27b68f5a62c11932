// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bodies of many images: lines of JSON, TAR archives. The first byte says which: even, a TAR.
#include <optional>

#include "index/files/text.h"
#include "server/http/message.h"
#include "server/jobs/bulk_items.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/refusal.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Answers;
  using pliant::fuzz::Require;
  namespace server = pliant::server;
  pliant::fuzz::Input input(data, size);
  const bool is_tar = pliant::fuzz::TakeByte(input) % 2 == 0;
  const std::string_view body = pliant::fuzz::TextOf(input);
  std::optional<server::BulkItems> items;
  const auto read = [&] {
    items.emplace(body, is_tar ? server::kTarType : server::kNdjsonType,
                  server::BulkDefaults{"", "{}", "auto"});
  };
  if (!Answers(read)) return 0;
  Require(items->size() > 0 && items->size() <= server::kMostBulkItems, "so many items");
  for (std::size_t i = 0; i < items->size(); ++i) {
    Require(pliant::IsValidUtf8(items->NameOf(i)), "names can be shown");
    const auto look = [&] {
      const server::BulkItem item = items->Item(i);
      const pliant::Bytes bytes = item.request.bytes;
      const bool inside = bytes.empty() || item.decoded ||
                          (bytes.data() >= input.data() &&
                           bytes.data() + bytes.size() <= input.data() + input.size());
      Require(inside, "an image is part of the body");
      Require(pliant::IsValidUtf8(item.request.object), "an object is text");
    };
    (void)Answers(look);
  }
  return 0;
}
