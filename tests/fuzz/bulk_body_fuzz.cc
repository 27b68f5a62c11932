// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bodies of many images: lines of JSON, TAR archives, tables. The first byte says which.
#include <optional>

#include "index/files/text.h"
#include "index/json/record_csv.h"
#include "server/http/message.h"
#include "server/jobs/bulk_items.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/refusal.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Answers;
  using pliant::fuzz::Require;
  namespace server = pliant::server;
  pliant::fuzz::Input input(data, size);
  // Even: a TAR.
  const unsigned first = pliant::fuzz::TakeByte(input);
  const char* const type = first % 2 == 0   ? server::kTarType
                           : first % 4 == 1 ? server::kNdjsonType
                                            : pliant::kCsvType;
  const std::string_view body = pliant::fuzz::TextOf(input);
  std::optional<server::BulkItems> items;
  const auto read = [&] { items.emplace(body, type, server::BulkDefaults{"", "{}", "auto"}); };
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
