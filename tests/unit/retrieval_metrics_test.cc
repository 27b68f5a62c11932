// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/retrieval_metrics.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/unit/expect_error.h"

namespace pliant {
namespace {

using testing::ExpectError;

// Right at ranks 1, 3 and 6 of 8, of 4 possible:
//   precision at these ranks 1, 2/3, 3/6; AP = (1 + 2/3 + 1/2) / 4 = 13/24.
TEST(RetrievalMetricsTest, AgreesWithAHandComputedAnswer) {
  const RetrievalMetrics m =
      MeasureAnswer({{true, false, true, false, false, true, false, false}, 4});
  EXPECT_DOUBLE_EQ(m.map, 13.0 / 24);
  EXPECT_DOUBLE_EQ(m.top1, 1);
  EXPECT_DOUBLE_EQ(m.mrr, 1);
  EXPECT_DOUBLE_EQ(m.ns, 2);
  EXPECT_DOUBLE_EQ(m.accuracy_at[0], 1);
  EXPECT_DOUBLE_EQ(m.accuracy_at[1], 0.5);
  EXPECT_DOUBLE_EQ(m.accuracy_at[2], 2.0 / 3);
  EXPECT_DOUBLE_EQ(m.accuracy_at[4], 2.0 / 5);
  EXPECT_DOUBLE_EQ(m.accuracy_at[5], 3.0 / 6);
  EXPECT_DOUBLE_EQ(m.accuracy_at[9], 3.0 / 10);  // beyond the answer: nothing more is right
  EXPECT_DOUBLE_EQ(m.accuracy_at[19], 3.0 / 20);
}

TEST(RetrievalMetricsTest, FirstRightAtTheThirdRank) {
  const RetrievalMetrics m = MeasureAnswer({{false, false, true}, 1});
  EXPECT_DOUBLE_EQ(m.map, 1.0 / 3);
  EXPECT_DOUBLE_EQ(m.top1, 0);
  EXPECT_DOUBLE_EQ(m.mrr, 1.0 / 3);
  EXPECT_DOUBLE_EQ(m.ns, 1);
}

TEST(RetrievalMetricsTest, PerfectAndEmptyAnswers) {
  RetrievalAnswer perfect{std::vector<bool>(20, true), 20};
  RetrievalMetrics m = MeasureAnswer(perfect);
  for (const double accuracy : m.accuracy_at) EXPECT_DOUBLE_EQ(accuracy, 1);
  EXPECT_DOUBLE_EQ(m.map, 1);
  EXPECT_DOUBLE_EQ(m.ns, 4);
  m = MeasureAnswer({{}, 3});
  for (const double accuracy : m.accuracy_at) EXPECT_DOUBLE_EQ(accuracy, 0);
  EXPECT_DOUBLE_EQ(m.map, 0);
  EXPECT_DOUBLE_EQ(m.mrr, 0);
  EXPECT_DOUBLE_EQ(m.ns, 0);
}

// A right image far beyond rank 20 counts for the average precision.
TEST(RetrievalMetricsTest, WhatIsSaidToBeFoundIsRightOrWrong) {
  RetrievalAnswer answer{{false, true}, 1};
  RetrievalMetrics m = MeasureAnswer(answer);
  EXPECT_DOUBLE_EQ(m.found_right + m.found_wrong, 0);
  answer.found = true;
  m = MeasureAnswer(answer);
  EXPECT_DOUBLE_EQ(m.found_right, 0);
  EXPECT_DOUBLE_EQ(m.found_wrong, 1);
  answer.right = {true, false};
  const RetrievalMetrics right = MeasureAnswer(answer);
  EXPECT_DOUBLE_EQ(right.found_right, 1);
  EXPECT_DOUBLE_EQ(right.found_wrong, 0);
  EXPECT_DOUBLE_EQ(Mean(std::vector{m, right}).found_wrong, 0.5);
}

TEST(RetrievalMetricsTest, AveragePrecisionReadsTheWholeAnswer) {
  RetrievalAnswer answer{std::vector<bool>(50, false), 2};
  answer.right[0] = true;
  answer.right[49] = true;
  const RetrievalMetrics m = MeasureAnswer(answer);
  EXPECT_DOUBLE_EQ(m.map, (1 + 2.0 / 50) / 2);
  EXPECT_DOUBLE_EQ(m.accuracy_at[19], 1.0 / 20);
}

TEST(RetrievalMetricsTest, ImpossibleAnswersAreRefused) {
  ExpectError(ErrorCode::kInvalidArgument, "answer_invalid", [] { MeasureAnswer({{false}, 0}); });
  ExpectError(ErrorCode::kInvalidArgument, "answer_invalid",
              [] { MeasureAnswer({{true, true}, 1}); });
}

TEST(RetrievalMetricsTest, MeanAndSpreadFieldByField) {
  std::vector<RetrievalMetrics> all(3);
  for (int i = 0; i < 3; ++i) {
    all[i].map = 0.1 * (i + 1);  // 0.1, 0.2, 0.3
    all[i].accuracy_at[7] = i;   // 0, 1, 2
    all[i].ns = 4;
  }
  const RetrievalMetrics mean = Mean(all);
  EXPECT_NEAR(mean.map, 0.2, 1e-12);
  EXPECT_DOUBLE_EQ(mean.accuracy_at[7], 1);
  EXPECT_DOUBLE_EQ(mean.accuracy_at[6], 0);
  EXPECT_DOUBLE_EQ(mean.ns, 4);
  const RetrievalMetrics spread = Spread(all);
  EXPECT_NEAR(spread.map, 0.1, 1e-12);
  EXPECT_DOUBLE_EQ(spread.accuracy_at[7], 1);
  EXPECT_DOUBLE_EQ(spread.ns, 0);
  EXPECT_DOUBLE_EQ(Spread(std::span(all).first(1)).map, 0);
  EXPECT_DOUBLE_EQ(Mean({}).map, 0);
}

}  // namespace
}  // namespace pliant
