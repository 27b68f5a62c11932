// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/retrieval_set.h"

#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

using ::testing::ElementsAre;
using testing::ExpectError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using testing::TemporaryFolder;
using testing::WriteText;

class RetrievalSetTest : public ::testing::Test {
 protected:
  // Readers look at names only.
  void Touch(const std::vector<std::string>& names) {
    for (const std::string& name : names) WriteText(folder_ / name, "x");
  }
  RetrievalSet Read(RetrievalLayout layout = RetrievalLayout::kAuto,
                    const std::vector<std::filesystem::path>& distractors = {}) {
    return ReadRetrievalSet(folder_.path(), layout, distractors);
  }
  // "name object roles" of each image: q = query, s = searched.
  std::vector<std::string> Lines(const RetrievalSet& set) {
    std::vector<std::string> lines;
    for (const RetrievalImage& p : set.images) {
      lines.push_back(p.path.lexically_relative(folder_.path()).string() + " " + p.object + " " +
                      (p.is_query ? "q" : "") + (p.is_searched ? "s" : ""));
    }
    return lines;
  }

  TemporaryFolder folder_;
};

TEST_F(RetrievalSetTest, ObjectsWithReferences) {
  Touch({"mug/ref.jpg", "mug/b.jpg", "mug/a.png", "hat/Ref_2.jpg", "hat/deep/v.jpg", "loose.jpg",
         "mug/notes.txt", ".hidden/x.jpg"});
  const RetrievalSet set = Read();
  EXPECT_EQ(set.layout, RetrievalLayout::kObjects);
  EXPECT_FALSE(set.counts_itself);
  EXPECT_THAT(Lines(set), ElementsAre("hat/Ref_2.jpg hat q", "hat/deep/v.jpg hat s",
                                      "mug/a.png mug s", "mug/b.jpg mug s", "mug/ref.jpg mug q"));
  EXPECT_THAT(CountRightAnswers(set), ElementsAre(1U, 0U, 1U, 1U, 2U));
  ASSERT_THAT(set.skipped, SizeIs(1));
  EXPECT_THAT(set.skipped[0].file, HasSubstr("loose.jpg"));
}

TEST_F(RetrievalSetTest, ObjectsWithoutReferencesQueryAllOthers) {
  Touch({"a/1.jpg", "a/2.jpg", "a/3.jpg", "b/1.jpg", "b/2.jpg", "alone/1.jpg"});
  const RetrievalSet set = Read();
  EXPECT_THAT(Lines(set), ElementsAre("a/1.jpg a qs", "a/2.jpg a qs", "a/3.jpg a qs",
                                      "alone/1.jpg alone s", "b/1.jpg b qs", "b/2.jpg b qs"));
  EXPECT_THAT(CountRightAnswers(set), ElementsAre(2U, 2U, 2U, 0U, 1U, 1U));  // never itself
  EXPECT_THAT(set.skipped, IsEmpty());
}

TEST_F(RetrievalSetTest, AReferenceWithoutViewsIsNamed) {
  Touch({"a/ref.jpg", "a/1.jpg", "b/ref.jpg", "c/1.jpg"});
  const RetrievalSet set = Read();
  EXPECT_THAT(Lines(set), ElementsAre("a/1.jpg a s", "a/ref.jpg a q", "c/1.jpg c s"));
  ASSERT_THAT(set.skipped, SizeIs(1));
  EXPECT_EQ(set.skipped[0].code, "no_right_answer");
  EXPECT_THAT(set.skipped[0].file, HasSubstr("b/ref.jpg"));
}

TEST_F(RetrievalSetTest, UkbenchCountsInFours) {
  for (const int i : {0, 1, 2, 3, 4, 5, 6, 7, 10199}) {
    std::string number = std::to_string(i);
    Touch({"ukbench" + std::string(5 - number.size(), '0') + number + ".jpg"});
  }
  Touch({"ukbench0001.jpg", "other.jpg"});
  const RetrievalSet set = Read();
  EXPECT_EQ(set.layout, RetrievalLayout::kUkbench);
  EXPECT_TRUE(set.counts_itself);
  EXPECT_THAT(
      Lines(set),
      ElementsAre("ukbench00000.jpg 0 qs", "ukbench00001.jpg 0 qs", "ukbench00002.jpg 0 qs",
                  "ukbench00003.jpg 0 qs", "ukbench00004.jpg 1 qs", "ukbench00005.jpg 1 qs",
                  "ukbench00006.jpg 1 qs", "ukbench00007.jpg 1 qs", "ukbench10199.jpg 2549 qs"));
  EXPECT_THAT(CountRightAnswers(set), ElementsAre(4U, 4U, 4U, 4U, 4U, 4U, 4U, 4U, 1U));
  EXPECT_THAT(set.skipped, SizeIs(2));
}

TEST_F(RetrievalSetTest, PairsHaveOneRightAnswer) {
  Touch({"query/7.jpg", "query/8.png", "query/9.jpg", "gallery/8.jpg", "gallery/7.png",
         "gallery/x.jpg"});
  const RetrievalSet set = Read();
  EXPECT_EQ(set.layout, RetrievalLayout::kPairs);
  EXPECT_THAT(Lines(set), ElementsAre("query/7.jpg 7 q", "query/8.png 8 q", "gallery/7.png 7 s",
                                      "gallery/8.jpg 8 s", "gallery/x.jpg x s"));
  EXPECT_THAT(set.skipped, SizeIs(1));  // query/9 has no partner
}

TEST_F(RetrievalSetTest, LabelsAreTheLeadingRunOfTheName) {
  Touch({"ref/mug12_a.jpg", "ref/hat_a.jpg", "query/mug12_b.jpg", "query/hat-c.jpg"});
  const RetrievalSet set = Read();
  EXPECT_EQ(set.layout, RetrievalLayout::kLabels);
  EXPECT_THAT(Lines(set), ElementsAre("query/hat-c.jpg hat q", "query/mug12_b.jpg mug12 q",
                                      "ref/hat_a.jpg hat s", "ref/mug12_a.jpg mug12 s"));
}

TEST_F(RetrievalSetTest, DistractorsAreSearchedAndNeverRight) {
  Touch({"a/ref.jpg", "a/1.jpg", "a/2.jpg"});  // one object is enough then
  TemporaryFolder more;
  WriteText(more / "sub/d.jpg", "x");
  const RetrievalSet set = Read(RetrievalLayout::kAuto, {more.path()});
  ASSERT_THAT(set.images, SizeIs(4));
  EXPECT_EQ(set.images[3].object, "");
  EXPECT_TRUE(set.images[3].is_searched);
  EXPECT_FALSE(set.images[3].is_query);
  EXPECT_THAT(CountRightAnswers(set), ElementsAre(1U, 1U, 2U, 0U));
}

TEST_F(RetrievalSetTest, BadFoldersAreRefusedWithTheReason) {
  ExpectError(ErrorCode::kNotFound, "folder_not_found",
              [&] { ReadRetrievalSet(folder_ / "absent", RetrievalLayout::kAuto); });
  ExpectError(ErrorCode::kUnprocessable, "layout_unknown", [&] { Read(); });  // empty
  ExpectError(ErrorCode::kUnprocessable, "nothing_to_search",
              [&] { Read(RetrievalLayout::kObjects); });
  ExpectError(ErrorCode::kUnprocessable, "layout_unknown", [&] { Read(RetrievalLayout::kPairs); });
  Touch({"just.jpg"});
  ExpectError(ErrorCode::kUnprocessable, "layout_unknown", [&] { Read(); });
  Touch({"a/ref.jpg", "a/1.jpg"});
  ExpectError(ErrorCode::kUnprocessable, "one_object", [&] { Read(); });
  Touch({"b/1.jpg"});
  EXPECT_THAT(Read().images, SizeIs(3));
  TemporaryFolder empty;
  ExpectError(ErrorCode::kUnprocessable, "no_distractors",
              [&] { Read(RetrievalLayout::kAuto, {empty.path()}); });
  ExpectError(ErrorCode::kUnprocessable, "no_absent", [&] {
    ReadRetrievalSet(folder_.path(), RetrievalLayout::kAuto, {}, {empty.path()});
  });
  ExpectError(ErrorCode::kNotFound, "input_not_found",
              [&] { Read(RetrievalLayout::kAuto, {empty / "absent"}); });
}

TEST_F(RetrievalSetTest, NoQueryHasAnAnswer) {
  Touch({"a/1.jpg", "b/1.jpg", "c/1.jpg"});
  ExpectError(ErrorCode::kUnprocessable, "no_queries", [&] { Read(); });
}

}  // namespace
}  // namespace pliant
