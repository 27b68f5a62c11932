// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/quantizer.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/random_descriptors.h"

namespace pliant::testing {
namespace {

std::shared_ptr<const Vocabulary> MakeVocabulary(Descriptors words) {
  auto vocabulary = std::make_shared<Vocabulary>();
  vocabulary->words = std::move(words);
  vocabulary->model_id = "test:1";
  return vocabulary;
}

std::uint32_t Nearest(const Descriptors& rows, std::size_t i, const Descriptors& words) {
  std::uint32_t best = 0;
  for (std::uint32_t w = 1; w < words.rows; ++w) {
    if (PlainDistance(rows, i, words, w) < PlainDistance(rows, i, words, best)) best = w;
  }
  return best;
}

void ExpectExact(const Descriptors& rows, const Descriptors& words) {
  const Quantizer quantizer(MakeVocabulary(words));
  const auto assigned = quantizer.Assign(rows, 1);
  ASSERT_EQ(assigned.size(), rows.rows);
  for (std::size_t i = 0; i < rows.rows; ++i) {
    ASSERT_EQ(assigned[i], Nearest(rows, i, words)) << "row " << i;
  }
  EXPECT_EQ(quantizer.Assign(rows, 2), assigned);
  EXPECT_EQ(quantizer.Assign(rows, 3), assigned);
}

TEST(Quantizer, AgreesWithTryingAllWords) {
  for (const int dim : {1, 3, 32, 128}) {
    for (const std::size_t k : {1U, 2U, 31U, 33U, 300U}) {
      SCOPED_TRACE("dim " + std::to_string(dim) + ", k " + std::to_string(k));
      ExpectExact(RandomFloats(700, dim, dim + k), RandomFloats(k, dim, 99 + k));
      ExpectExact(RandomBits(300, dim, dim + k), RandomBits(k, dim, 99 + k));
    }
  }
}

// Equally near words are the rule here: the lowest must win.
TEST(Quantizer, TiesGoToTheLowestWord) {
  ExpectExact(RandomGrid(500, 3, 3, 1), RandomGrid(100, 3, 3, 2));
  ExpectExact(RandomBits(500, 1, 1), RandomBits(100, 1, 2));
}

// Far from the origin |x|^2 + |w|^2 - 2 x.w loses all digits that tell the words apart.
TEST(Quantizer, ExactFarFromTheOrigin) {
  auto rows = RandomGrid(400, 16, 8, 3);
  auto words = RandomGrid(50, 16, 8, 4);
  for (float& x : rows.floats) x += 30000;
  for (float& x : words.floats) x += 30000;
  ExpectExact(rows, words);
}

TEST(Quantizer, NoDescriptorsNoWords) {
  const Quantizer quantizer(MakeVocabulary(RandomFloats(5, 4, 1)));
  EXPECT_TRUE(quantizer.Assign(Descriptors::Float(0, 4)).empty());
}

template <typename Action>
void ExpectError(ErrorCode code, const char* reason, Action&& action) {
  try {
    action();
    ADD_FAILURE() << "accepted; expected " << reason;
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), code);
    EXPECT_EQ(e.reason(), reason);
  }
}

TEST(Quantizer, RefusesWhatDoesNotFit) {
  const Quantizer quantizer(MakeVocabulary(RandomFloats(5, 4, 1)));
  ExpectError(ErrorCode::kConflict, "vocabulary_mismatch",
              [&] { quantizer.Assign(RandomFloats(5, 5, 1)); });
  ExpectError(ErrorCode::kConflict, "vocabulary_mismatch",
              [&] { quantizer.Assign(RandomBits(5, 4, 1)); });
  auto bad = RandomFloats(5, 4, 1);
  bad.floats[3] = std::numeric_limits<float>::infinity();
  ExpectError(ErrorCode::kInvalidArgument, "descriptors_not_finite",
              [&] { quantizer.Assign(bad); });
  ExpectError(ErrorCode::kInvalidArgument, "descriptors_not_finite",
              [&] { Quantizer(MakeVocabulary(bad)); });
  ExpectError(ErrorCode::kInvalidArgument, "vocabulary_empty", [&] { Quantizer(nullptr); });
  ExpectError(ErrorCode::kInvalidArgument, "vocabulary_empty",
              [&] { Quantizer(MakeVocabulary(Descriptors::Float(0, 4))); });
}

TEST(Bow, CountsWords) {
  const Bow bow = MakeBow({7, 1, 7, 3, 7, 1});
  EXPECT_EQ(bow.total, 6U);
  EXPECT_THAT(bow.words, ::testing::ElementsAre(WordCount{1, 2}, WordCount{3, 1}, WordCount{7, 3}));
  EXPECT_EQ(MakeBow({}).total, 0U);
  EXPECT_TRUE(MakeBow({}).words.empty());
}

}  // namespace
}  // namespace pliant::testing
