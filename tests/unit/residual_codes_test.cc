// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Codes of descriptors, and the scan that compares a query with many of them.
#include "vocab/residual_codes.h"

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/match/distance.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/random_descriptors.h"
#include "vocab/code_scan.h"
#include "vocab/row_coding.h"

namespace pliant {
namespace {

using testing::Coded;
using testing::ExpectError;

constexpr int kDim = 24;

// Unit vectors around a few centres, with components that depend on each other; in the precision
// in which they are stored.
Descriptors Clustered(std::size_t rows, std::uint32_t seed, int dim = kDim) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  Descriptors descriptors = Descriptors::Float(rows, dim);
  for (std::size_t i = 0; i < rows; ++i) {
    float* row = descriptors.floats.data() + i * dim;
    const std::size_t centre = i % 7;
    float before = 0;
    double squared = 0;
    for (int d = 0; d < dim; ++d) {
      before = 0.7F * before + 0.3F * normal(random);
      row[d] = before + 0.5F * std::sin(static_cast<float>(centre * 3 + 1) * (d + 1));
      squared += static_cast<double>(row[d]) * row[d];
    }
    for (int d = 0; d < dim; ++d) row[d] /= static_cast<float>(std::sqrt(squared));
  }
  return GetDescriptors(Coded(descriptors).view());
}

struct Trained {
  std::shared_ptr<Vocabulary> vocabulary;
  std::vector<std::uint32_t> assignment;
};

Trained Train(const Descriptors& samples, int bytes) {
  Trained trained{std::make_shared<Vocabulary>(), {}};
  std::vector<std::uint32_t> medoids(7);
  std::iota(medoids.begin(), medoids.end(), 0U);
  trained.vocabulary->words = SelectRows(samples, medoids);
  const PackedDescriptors packed(trained.vocabulary->words);
  std::vector<NearestTwo> nearest(samples.rows);
  packed.FindNearest(samples, 0, samples.rows, nearest.data());
  for (const NearestTwo& one : nearest) trained.assignment.push_back(one.index);
  trained.vocabulary->codebook =
      TrainCodebook(samples, trained.assignment, trained.vocabulary->words, bytes);
  return trained;
}

template <typename T>
double SquaredDistance(const float* a, const T* b, std::size_t dim) {
  double sum = 0;
  for (std::size_t d = 0; d < dim; ++d) sum += std::pow(static_cast<double>(a[d]) - b[d], 2);
  return sum;
}
double SquaredDistance(std::span<const float> a, std::span<const float> b) {
  return SquaredDistance(a.data(), b.data(), a.size());
}

// The list of all samples of one word, and which they are.
struct WordList {
  std::vector<std::uint8_t> codes;
  std::vector<std::int16_t> biases;
  std::vector<std::size_t> rows;
  CodeList list;
};

WordList ListOf(const Trained& trained, const ResidualCoder& coder, const Descriptors& samples,
                std::uint32_t word) {
  WordList result;
  std::vector<std::uint8_t> row_major;
  const Coded coded(samples);
  for (std::uint32_t i = 0; i < samples.rows; ++i) {
    if (trained.assignment[i] != word) continue;
    const Codes codes = coder.Encode(coded.view(), {&i, 1}, {&word, 1});
    const std::vector<std::uint8_t>& code = codes.bytes;
    row_major.insert(row_major.end(), code.begin(), code.end());
    result.biases.push_back(coder.binary() ? std::int16_t{0} : codes.biases.at(0));
    result.rows.push_back(i);
  }
  AppendCodes(row_major.data(), result.rows.size(), coder.code_bytes(), &result.codes);
  result.list = {nullptr, nullptr, result.rows.size(), coder.code_bytes()};
  std::vector<std::uint8_t> code(coder.code_bytes());
  result.list.codes = result.codes.data();
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    CopyCode(result.list, i, code.data());
    EXPECT_TRUE(std::equal(code.begin(), code.end(), row_major.begin() + i * code.size()));
  }
  result.codes.resize(result.codes.size() + kCodePadding);
  result.list.codes = result.codes.data();
  result.list.biases = result.biases.data();
  return result;
}

TEST(ResidualCodesTest, EstimatedDistancesAreNearTheTrueOnes) {
  const Descriptors samples = Clustered(3000, 1);
  const Descriptors queries = Clustered(40, 2);
  double last_error = std::numeric_limits<double>::infinity();
  for (const int bytes : {3, 6, 12}) {
    const Trained trained = Train(samples, bytes);
    const ResidualCoder coder(trained.vocabulary);
    ASSERT_EQ(coder.code_bytes(), static_cast<std::size_t>(bytes));
    double error = 0;
    std::size_t compared = 0;
    for (std::uint32_t word = 0; word < 7; ++word) {
      const WordList list = ListOf(trained, coder, samples, word);
      ASSERT_NE(list.rows.size() % kCodeBlock, 0U) << "the last block should be a short one";
      for (std::size_t q = 0; q < queries.rows; ++q) {
        const LookupTable table = coder.TableOf(queries.float_row(q));
        CodeQuery query;
        query.table = &table;
        query.bias_step = coder.bias_step();
        query.base = static_cast<float>(
            SquaredDistance(queries.float_row(q), trained.vocabulary->words.float_row(word)));
        query.limit = std::numeric_limits<float>::infinity();
        std::vector<NearCode> near(list.rows.size());
        ASSERT_EQ(ScanCodes(list.list, query, near.data()), list.rows.size());
        for (const NearCode& one : near) {
          const double truth =
              SquaredDistance(queries.float_row(q), samples.float_row(list.rows[one.index]));
          error += std::abs(one.squared_distance - truth);
          ++compared;
        }
      }
    }
    error /= static_cast<double>(compared);
    EXPECT_LT(error, 0.7 * last_error) << bytes << " bytes";
    last_error = error;
  }
  EXPECT_LT(last_error, 0.08);  // of squared distances up to 4
}

// Sizes that fill registers, and sizes that do not.
TEST(ResidualCodesTest, CodesAreTheNearestCentroidsOfTheRotatedResidual) {
  for (const auto& [dim, bytes] : {std::pair{64, 16}, {128, 16}, {22, 4}, {2, 1}, {96, 48}}) {
    const Descriptors samples = Clustered(200, 9, dim);
    const Trained trained = Train(samples, bytes);
    const Codebook& book = trained.vocabulary->codebook;
    const ResidualCoder coder(trained.vocabulary);
    std::vector<std::uint32_t> rows(samples.rows);
    std::iota(rows.begin(), rows.end(), 0U);
    const auto [codes, biases] = coder.Encode(Coded(samples).view(), rows, trained.assignment);
    ASSERT_EQ(codes.size(), samples.rows * coder.code_bytes());
    ASSERT_EQ(biases.size(), samples.rows);
    const auto part_dim = static_cast<std::size_t>(book.part_dim);
    for (std::size_t i = 0; i < samples.rows; ++i) {
      const auto word = trained.vocabulary->words.float_row(trained.assignment[i]);
      std::vector<double> residual(book.padded_dim(), 0);
      double bias = 0;
      for (std::size_t r = 0; r < residual.size(); ++r) {
        const auto row = std::span(book.rotation).subspan(r * dim, dim);
        const std::size_t p = r / part_dim;
        const std::uint8_t byte = codes[i * coder.code_bytes() + p / 2];
        const std::size_t c = p % 2 == 0 ? byte & 15U : byte >> 4U;
        const double centroid = book.centroids[(p * 16 + c) * part_dim + r % part_dim];
        double of_word = 0;
        for (std::size_t d = 0; d < row.size(); ++d) {
          residual[r] += row[d] * (static_cast<double>(samples.float_row(i)[d]) - word[d]);
          of_word += static_cast<double>(row[d]) * word[d];
        }
        bias += centroid * (centroid + 2 * of_word);
      }
      EXPECT_NEAR(biases[i] * coder.bias_step(), bias, 0.02);  // the rotation has 8 bits
      for (std::size_t p = 0; p < book.parts(); ++p) {
        const auto distance = [&](std::size_t c) {
          const float* centroid = book.centroids.data() + (p * 16 + c) * part_dim;
          return SquaredDistance(centroid, residual.data() + p * part_dim, part_dim);
        };
        double least = distance(0);
        for (std::size_t c = 1; c < 16; ++c) least = std::min(least, distance(c));
        const std::uint8_t byte = codes[i * coder.code_bytes() + p / 2];
        EXPECT_NEAR(distance(p % 2 == 0 ? byte & 15U : byte >> 4U), least, 0.02);
      }
    }
  }
}

// Whatever the values are, and whether one register is enough or not.
TEST(ResidualCodesTest, AllProcessorsMakeTheSameCodes) {
  std::mt19937 random(5);
  const auto fill = [&](auto* values, std::size_t count, int low, int high) {
    std::uniform_int_distribution<int> value(low, high);
    values->resize(count);
    for (auto& one : *values) {
      one = static_cast<std::decay_t<decltype(one)>>(value(random));
    }
  };
  for (const auto& [lanes, components, bytes] :
       {std::tuple{32, 2, 32}, {16, 4, 1}, {16, 6, 8}, {48, 2, 20}, {256, 2, 256}}) {
    RowTables tables;
    tables.lanes = static_cast<std::size_t>(lanes);
    tables.outputs = tables.lanes * components;
    tables.bytes = static_cast<std::size_t>(bytes);
    tables.pairs = (tables.bytes + kPairsAtOnce - 1) / kPairsAtOnce * kPairsAtOnce;
    for (int round = 0; round < 50; ++round) {
      fill(&tables.rotation, 2 * tables.pairs * tables.outputs, -127, 127);
      fill(&tables.middles, tables.outputs, -(1 << 20), 1 << 20);
      fill(&tables.centroids, 16 * tables.outputs, -511, 511);
      for (std::int16_t& value : tables.centroids) value = static_cast<std::int16_t>(16 * value);
      fill(&tables.norms, 16 * tables.lanes, 0, (1 << 26) - 1);
      for (std::size_t i = 0; i < tables.norms.size(); ++i) {
        tables.norms[i] = tables.norms[i] * 16 + static_cast<int>(i / tables.lanes);
      }
      std::vector<std::int16_t> word;
      fill(&word, tables.outputs, -32767, 32767);
      std::vector<std::uint8_t> levels;
      fill(&levels, tables.bytes, 0, 255);
      for (const float factor : {0.0F, 0.01F, 0.3F, 1e30F, INFINITY}) {
        RowScratch one(tables);
        RowScratch other(tables);
        ASSERT_EQ(CodeRow(tables, levels.data(), factor, word.data(), &one),
                  CodeRowAnywhere(tables, levels.data(), factor, word.data(), &other));
        ASSERT_EQ(one.nearest, other.nearest);
        ASSERT_EQ(one.residual, other.residual);
      }
    }
  }
}

TEST(ResidualCodesTest, OnlyWhatIsNearerThanTheLimitIsReturnedInOrder) {
  const Descriptors samples = Clustered(1000, 3);
  const Trained trained = Train(samples, 12);
  const ResidualCoder coder(trained.vocabulary);
  const WordList list = ListOf(trained, coder, samples, 2);
  const LookupTable table = coder.TableOf(samples.float_row(list.rows[5]));
  CodeQuery query;
  query.table = &table;
  query.bias_step = coder.bias_step();
  query.base = static_cast<float>(
      SquaredDistance(samples.float_row(list.rows[5]), trained.vocabulary->words.float_row(2)));
  query.limit = std::numeric_limits<float>::infinity();
  std::vector<NearCode> all(list.rows.size());
  ScanCodes(list.list, query, all.data());
  query.limit = 0.2F;
  std::vector<NearCode> some(list.rows.size());
  some.resize(ScanCodes(list.list, query, some.data()));
  std::size_t expected = 0;
  for (const NearCode& one : all) {
    if (one.squared_distance >= query.limit) continue;
    ASSERT_LT(expected, some.size());
    EXPECT_EQ(some[expected].index, one.index);
    EXPECT_EQ(some[expected].squared_distance, one.squared_distance);
    ++expected;
  }
  EXPECT_EQ(expected, some.size());
  EXPECT_THAT(some, ::testing::Contains(::testing::Field(&NearCode::index, 5U)));
  EXPECT_LT(some.size(), all.size());
}

TEST(ResidualCodesTest, TheRotationIsOneAndTrainingIsRepeatable) {
  const Descriptors samples = Clustered(500, 4, 22);  // 22 components in 8 parts: padded to 24
  const Trained once = Train(samples, 4);
  const Trained again = Train(samples, 4);
  const Codebook& book = once.vocabulary->codebook;
  EXPECT_EQ(book.padded_dim(), 24U);
  EXPECT_EQ(book.rotation, again.vocabulary->codebook.rotation);
  EXPECT_EQ(book.centroids, again.vocabulary->codebook.centroids);
  for (std::size_t a = 0; a < 22; ++a) {
    for (std::size_t b = 0; b < 22; ++b) {
      double dot = 0;
      for (std::size_t r = 0; r < 24; ++r) {
        dot += static_cast<double>(book.rotation[r * 22 + a]) * book.rotation[r * 22 + b];
      }
      EXPECT_NEAR(dot, a == b ? 1 : 0, 1e-3);
    }
  }
}

TEST(ResidualCodesTest, FewAndEqualSamplesAreEnough) {
  Descriptors samples = Descriptors::Float(3, kDim);
  samples.floats[0] = 1;
  samples.floats[kDim] = 1;
  samples.floats[2 * kDim + 1] = 1;
  const Trained trained = [&] {
    Trained made{std::make_shared<Vocabulary>(), {0, 0, 0}};
    made.vocabulary->words = SelectRows(samples, std::vector<std::uint32_t>{0});
    made.vocabulary->codebook =
        TrainCodebook(samples, made.assignment, made.vocabulary->words, kDim / 4);
    return made;
  }();
  const ResidualCoder coder(trained.vocabulary);
  EXPECT_EQ(coder.code_bytes(), static_cast<std::size_t>(kDim / 4));
  const WordList list = ListOf(trained, coder, samples, 0);
  const LookupTable table = coder.TableOf(samples.float_row(2));
  CodeQuery query;
  query.table = &table;
  query.base = 2;
  query.bias_step = coder.bias_step();
  query.limit = std::numeric_limits<float>::infinity();
  std::vector<NearCode> near(3);
  ASSERT_EQ(ScanCodes(list.list, query, near.data()), 3U);
  EXPECT_NEAR(near[0].squared_distance, 2, 0.05);
  EXPECT_NEAR(near[2].squared_distance, 0, 0.05);
}

TEST(ResidualCodesTest, BinaryDescriptorsAreTheirOwnCodes) {
  std::mt19937 random(7);
  Descriptors samples = Descriptors::Binary(70, 32);
  for (std::uint8_t& byte : samples.bytes) byte = static_cast<std::uint8_t>(random());
  Trained trained{std::make_shared<Vocabulary>(), std::vector<std::uint32_t>(70, 0)};
  trained.vocabulary->words = SelectRows(samples, std::vector<std::uint32_t>{0});
  trained.vocabulary->codebook =
      TrainCodebook(samples, trained.assignment, trained.vocabulary->words, 1);
  const ResidualCoder coder(trained.vocabulary);
  const WordList list = ListOf(trained, coder, samples, 0);
  CodeQuery query;
  query.bits = samples.binary_row(40);
  query.limit = std::numeric_limits<float>::infinity();
  std::vector<NearCode> near(70);
  ASSERT_EQ(ScanCodes(list.list, query, near.data()), 70U);
  std::vector<float> truth(70);
  PackedDescriptors(samples).Distances(samples, 40, 1, truth.data());
  for (std::size_t i = 0; i < 70; ++i) EXPECT_EQ(near[i].squared_distance, truth[i]);
}

TEST(ResidualCodesTest, MalformedCodebooksAreRefused) {
  const Descriptors samples = Clustered(200, 8);
  const Trained good = Train(samples, 4);
  const auto refuse = [&](const auto& damage) {
    auto vocabulary = std::make_shared<Vocabulary>(*good.vocabulary);
    damage(&vocabulary->codebook);
    ExpectError(ErrorCode::kInvalidArgument, "codebook_malformed",
                [&] { ResidualCoder coder(vocabulary); });
  };
  refuse([](Codebook* book) { *book = {}; });
  refuse([](Codebook* book) { book->code_bytes = 3; });
  refuse([](Codebook* book) { book->code_bytes = -1; });
  refuse([](Codebook* book) { book->part_dim = 1; });
  refuse([](Codebook* book) { book->rotation.pop_back(); });
  refuse([](Codebook* book) { book->centroids.pop_back(); });
  refuse([](Codebook* book) { book->centroids[3] = std::nanf(""); });
  ExpectError(ErrorCode::kInvalidArgument, "code_bytes_invalid",
              [&] { TrainCodebook(samples, good.assignment, good.vocabulary->words, 0); });
}

}  // namespace
}  // namespace pliant
