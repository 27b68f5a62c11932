// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/judgement.h"

#include <gtest/gtest.h>

#include "index/records/search.h"

namespace pliant {
namespace {

TEST(Judgement, CombinedScoresNeverFallAndStayBelowOne) {
  for (const double score : {0.0, 1e-5, 0.2, 0.9, 1.0}) {
    EXPECT_EQ(LiftScore(score, Evidence(0)), score);  // no warp
    double before = score;
    for (int inliers = 6; inliers < 500; ++inliers) {
      const double combined = LiftScore(score, Evidence(inliers));
      if (score < 1) {
        EXPECT_GT(combined, before);
        EXPECT_LT(combined, 1);
      } else {
        EXPECT_LE(combined, 1);
      }
      before = combined;
    }
  }
}

// However many inliers there are, more of them and a higher score of the ranking both count.
TEST(Judgement, InliersMultiplyTheOdds) {
  const auto combined = [](double score, double inliers) {
    return LiftScore(score, Evidence(inliers));
  };
  EXPECT_NEAR(combined(0.5, 6), 39.0625 / 40.0625, 1e-12);
  EXPECT_NEAR(combined(0.2, 14), 12155.0625 / 12159.0625, 1e-12);
  EXPECT_GT(combined(0.02, 84), combined(0.02, 48));
  EXPECT_GT(combined(0.02, 358), combined(0.02, 200));
  EXPECT_GT(combined(0.03, 200), combined(0.02, 210));
  EXPECT_GT(combined(0.02, 15), combined(0.2, 5));
  EXPECT_EQ(combined(0.02, 5.25), 0.02) << "most of so few are chance";
}

TEST(Judgement, TheMoreKeypointsTheMoreInliersAgreeByChance) {
  EXPECT_DOUBLE_EQ(InliersByChance(0), 4.5);
  EXPECT_DOUBLE_EQ(InliersByChance(2048), 4.5);
  EXPECT_NEAR(InliersByChance(2896), 5.25, 1e-3);
  EXPECT_DOUBLE_EQ(InliersByChance(4096), 6);
  EXPECT_DOUBLE_EQ(InliersByChance(100'000), 6);
  EXPECT_DOUBLE_EQ(Evidence(8), 3.5);
  EXPECT_DOUBLE_EQ(Evidence(8, 6), 2);
  EXPECT_DOUBLE_EQ(Evidence(8, 6, 0.64), 1.6);
  EXPECT_EQ(Evidence(6.75, 6), 0) << "less than 1 counts as none";
  EXPECT_EQ(Evidence(8, 6, 0.1), 0);
  EXPECT_EQ(Evidence(0, 6), 0);
}

TEST(Judgement, WhereAllDetailsResembleEachOtherMoreInliersAgreeByChance) {
  EXPECT_DOUBLE_EQ(InliersByChance(500, 1.1, 0.5), 4.5) << "photos";
  EXPECT_GT(InliersByChance(500, 0.83, 0.5), 15) << "codes";
  EXPECT_DOUBLE_EQ(InliersByChance(500, 0.4, 1), 4.5) << "no match contradicts";
  EXPECT_GT(InliersByChance(500, 0.85, 0.4), InliersByChance(500, 0.85, 0.5));
  EXPECT_GT(InliersByChance(500, 0.75, 0.5), InliersByChance(500, 0.85, 0.5));
}

TEST(Judgement, WithoutEvidenceNothingIsFound) {
  for (const double ranked : {0.0, 0.01, 0.5, 1.0}) {
    EXPECT_LT(Probability(ranked, 0), kPerhapsProbability);
  }
  EXPECT_GT(Probability(0.002, 3.5), kFoundProbability);
}

TEST(Judgement, PixelsTellAnObjectFromItsSiblings) {
  const auto same = [](const std::optional<Appearance>& appearance, double inliers) {
    return SameObject(Likeness(appearance, inliers), true);
  };
  EXPECT_EQ(same({}, 8), 1) << "unknown";
  EXPECT_EQ(same(Appearance{0.6, 0.2}, 30), 1);
  EXPECT_LT(same(Appearance{0.1, 1.0}, 8), 0.1);
  const Appearance doubtful{0.25, 0.5};
  const double between = same(doubtful, 8);
  EXPECT_GT(between, 0.1);
  EXPECT_LT(between, 0.95);
  EXPECT_GT(same(Appearance{0.3, 0.5}, 8), between);
  EXPECT_GT(same(Appearance{0.25, 0.45}, 8), between);
  EXPECT_GT(same(Appearance{0.25, {}}, 8), between) << "grey";
  EXPECT_GT(same(doubtful, 9), between);
  EXPECT_GT(SameObject(Likeness(doubtful, 8), false), between) << "no sibling is known";
}

TEST(Judgement, ProbabilitiesAreWholePercentages) {
  EXPECT_EQ(Rounded(0), 0.01);
  EXPECT_EQ(Rounded(0.374), 0.37);
  EXPECT_EQ(Rounded(0.896), 0.9);
  EXPECT_EQ(Rounded(1), 0.99);
}

}  // namespace
}  // namespace pliant
