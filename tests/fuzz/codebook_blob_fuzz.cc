// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Codebooks as they are stored, and codes by them. The first three bytes of an input choose the
// words: kind, dimensions, and how many.
#include <memory>

#include "index/store/blob_codec.h"
#include "tests/fuzz/blob.h"
#include "vocab/residual_codes.h"

namespace {

using pliant::Descriptors;
using pliant::fuzz::Require;

Descriptors MakeWords(pliant::fuzz::Input& input) {
  const bool binary = pliant::fuzz::TakeByte(input) % 2 == 1;
  const int dim = 1 + pliant::fuzz::TakeByte(input) % 16;
  const std::size_t count = 1 + pliant::fuzz::TakeByte(input) % 8;
  Descriptors words = binary ? Descriptors::Binary(count, dim) : Descriptors::Float(count, dim);
  for (std::size_t i = 0; i < words.floats.size(); ++i) {
    words.floats[i] = static_cast<float>(i * 7 % 11) / 11 - 0.5F;
  }
  return words;
}

// Any descriptor has a code in any word, and a query looks all of them up.
void UseCodebook(const Descriptors& words, const pliant::Codebook& codebook) {
  auto vocabulary = std::make_shared<pliant::Vocabulary>();
  vocabulary->words = words;
  vocabulary->codebook = codebook;
  const pliant::ResidualCoder coder(vocabulary);
  std::vector<std::uint8_t> bytes;
  pliant::PutDescriptors(words, &bytes);
  const pliant::CodedDescriptors coded{words.kind, words.rows, words.dim, bytes};
  for (std::uint32_t row = 0; row < words.rows; ++row) {
    const auto word = static_cast<std::uint32_t>((row + 1) % words.rows);
    coder.Encode(coded, {&row, 1}, {&word, 1});
    if (coder.binary()) continue;
    Require(coder.TableOf(words.float_row(row)).entries.size() == codebook.parts() * 16,
            "a query has an entry for each centroid");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  pliant::fuzz::Input input(data, size);
  const Descriptors words = MakeWords(input);
  const std::vector<std::uint8_t> blob = pliant::fuzz::WithChecksum(input);
  pliant::Codebook codebook;
  if (!pliant::fuzz::Accepts([&] { codebook = pliant::DecodeCodebook(blob, words); })) return 0;
  const std::vector<std::uint8_t> again = pliant::EncodeCodebook(codebook);
  // A number may be written in more bytes than it needs.
  Require(again == blob || again.size() < blob.size(), "what is read can be written");
  Require(pliant::EncodeCodebook(pliant::DecodeCodebook(again, words)) == again,
          "what is written has one form");
  UseCodebook(words, codebook);
  return 0;
}
