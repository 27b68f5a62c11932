// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The words of an image as they are stored. The first byte of an input chooses the vocabulary's
// size.
#include <algorithm>

#include "index/store/blob_codec.h"
#include "tests/fuzz/blob.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Accepts;
  using pliant::fuzz::Require;
  pliant::fuzz::Input input(data, size);
  const std::size_t vocabulary = std::size_t{1} << pliant::fuzz::TakeByte(input) % 17;
  const std::vector<std::uint8_t> blob = pliant::fuzz::WithChecksum(input);
  std::vector<std::uint32_t> words;
  if (!Accepts([&] { words = pliant::DecodeWords(blob, vocabulary); })) return 0;
  Require(std::ranges::all_of(words, [&](std::uint32_t word) { return word < vocabulary; }),
          "words are of the vocabulary");
  Require(pliant::DecodeWords(pliant::EncodeWords(words), vocabulary) == words,
          "what is read can be written and read again");
  return 0;
}
