// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// All pages of a list at once.
#include <map>
#include <string>
#include <vector>

#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;

class PagesTest : public EngineTest {};

TEST_F(PagesTest, AllPagesAreOfOneState) {
  Engine engine(Options());
  AddMany(engine, 6);
  ImageListing list;
  list.limit = 2;
  std::vector<std::string> seen;
  engine.ForEachPage(list, [&](const ImagePage& page) {
    for (const ImageRecord& record : page.records) seen.push_back(record.id + record.object);
    if (seen.size() != 2) return;
    Engine other(Options());  // beside the reading
    other.Remove("default", "p5");
    ImageChange change;
    change.object = "changed";
    other.Change("default", "p6", change);
    Add(other, RandomPng(7), "o4", "p7");
  });
  EXPECT_THAT(seen, ElementsAre("p1o1", "p2o1", "p3o2", "p4o2", "p5o3", "p6o3"));
  EXPECT_EQ(engine.GetCollection("default").images, 6u);
  EXPECT_EQ(engine.Get("default", "p6").object, "changed");
}

TEST_F(PagesTest, AllFeaturesAreOfOneState) {
  Engine engine(Options());
  AddMany(engine, 6);
  ImageListing list;
  list.limit = 2;
  std::map<std::string, Features> before;
  for (int i = 1; i <= 6; ++i) {
    const std::string id = "p" + std::to_string(i);
    before[id] = engine.GetFeatures("default", id);
  }
  std::uint64_t counted = 0;
  std::vector<std::string> seen;
  engine.ForEachFeatures(
      list,
      [&](const ImagePage& page) {
        for (const ImageRecord& record : page.records) counted += record.keypoints;
        if (page.next) return;
        Engine other(Options());  // beside the reading, which is at its second turn
        other.Remove("default", "p2");
        Add(other, RandomPng(8), "o4", "p5");  // replaced
        Add(other, RandomPng(7), "o4", "p7");
      },
      [&](const ImageRecord& record, const Features& features) {
        seen.push_back(record.id);
        EXPECT_EQ(features.keypoints.size(), record.keypoints);
        EXPECT_EQ(features.keypoints, before.at(record.id).keypoints) << record.id;
        EXPECT_EQ(features.descriptors.floats, before.at(record.id).descriptors.floats);
        EXPECT_EQ(features.model_id, engine.Model().model_id);
        counted -= features.keypoints.size();
      });
  EXPECT_THAT(seen, ElementsAre("p1", "p2", "p3", "p4", "p5", "p6"));
  EXPECT_EQ(counted, 0U);
  EXPECT_EQ(engine.GetCollection("default").images, 6u);
  ExpectError(ErrorCode::kNotFound, "collection_not_found", [&] {
    list.which.collection = "none";
    engine.ForEachFeatures(
        list, [](const ImagePage&) {}, [](const ImageRecord&, const Features&) {});
  });
}

}  // namespace
}  // namespace pliant::testing
