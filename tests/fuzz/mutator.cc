// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/mutator.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace pliant::fuzz {
namespace {

constexpr std::size_t kMostBytes = 64 * 1024;

std::ptrdiff_t At(std::size_t position) { return static_cast<std::ptrdiff_t>(position); }

}  // namespace

std::size_t Mutator::Below(std::size_t limit) { return limit == 0 ? 0 : random_() % limit; }

ByteVector Mutator::Mutated(ByteVector bytes) {
  for (std::size_t changes = 1 + Below(4); changes > 0; --changes) ChangeOnce(bytes);
  if (bytes.size() > kMostBytes) bytes.resize(kMostBytes);
  return bytes;
}

void Mutator::ChangeOnce(ByteVector& bytes) {
  const std::size_t at = Below(bytes.size());
  switch (bytes.empty() ? 6 : Below(8)) {
    case 0:
      bytes[at] ^= static_cast<std::uint8_t>(1U << Below(8));
      break;
    case 1:
      bytes[at] = static_cast<std::uint8_t>(random_());
      break;
    case 2:
      SetNumber(bytes);
      break;
    case 3:  // a short part is left out
      bytes.erase(bytes.begin() + At(at),
                  bytes.begin() + At(std::min(bytes.size(), at + 1 + Below(16))));
      break;
    case 4:
      bytes.resize(at);
      break;
    case 5:
      InsertSome(bytes, ByteVector(bytes));
      break;
    case 6:
      InsertSome(bytes, corpus_[Below(corpus_.size())]);
      break;
    default: {  // of text: another digit, letter or mark
      constexpr std::array<char, 20> kMarks = {'0', '9', '-', '+', '.', 'e',  '"',  '\\', '{', '}',
                                               '[', ']', ',', ':', ';', '\r', '\n', ' ',  '%', 'A'};
      bytes[at] = static_cast<std::uint8_t>(kMarks[Below(kMarks.size())]);
      break;
    }
  }
}

// One that is at a limit, of one to four bytes and either order.
void Mutator::SetNumber(ByteVector& bytes) {
  constexpr std::array<std::uint32_t, 12> kNumbers = {
      0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
  const std::uint32_t number = kNumbers[Below(kNumbers.size())] + (Below(3) == 0 ? 1U : 0U);
  const std::size_t width = std::size_t{1} << Below(3);
  const bool big_endian = Below(2) == 0;
  const std::size_t at = Below(bytes.size());
  for (std::size_t i = 0; i < width && at + i < bytes.size(); ++i) {
    bytes[at + i] = static_cast<std::uint8_t>(number >> (8 * (big_endian ? width - 1 - i : i)));
  }
}

void Mutator::InsertSome(ByteVector& bytes, const ByteVector& from) {
  const std::size_t begin = Below(from.size());
  const std::size_t count = std::min(from.size() - begin, 1 + Below(64));
  bytes.insert(bytes.begin() + At(Below(bytes.size() + 1)), from.begin() + At(begin),
               from.begin() + At(begin + count));
}

}  // namespace pliant::fuzz
