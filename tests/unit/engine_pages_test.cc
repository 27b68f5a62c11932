// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// All pages of a list at once.
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
  PictureListing list;
  list.limit = 2;
  std::vector<std::string> seen;
  engine.ForEachPage(list, [&](const PicturePage& page) {
    for (const ImageRecord& record : page.records) seen.push_back(record.id + record.object);
    if (seen.size() != 2) return;
    Engine other(Options());  // beside the reading
    other.Remove("default", "p5");
    PictureChange change;
    change.object = "changed";
    other.Change("default", "p6", change);
    Add(other, RandomPng(7), "o4", "p7");
  });
  EXPECT_THAT(seen, ElementsAre("p1o1", "p2o1", "p3o2", "p4o2", "p5o3", "p6o3"));
  EXPECT_EQ(engine.GetCollection("default").images, 6u);
  EXPECT_EQ(engine.Get("default", "p6").object, "changed");
}

}  // namespace
}  // namespace pliant::testing
