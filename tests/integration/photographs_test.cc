// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Real photographs of Debian's package opencv-doc: one view of each object is indexed, another view
// asks for it. With DEAL, through the real program.
#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace pliant::testing {
namespace {

const std::filesystem::path kPhotographs = "/usr/share/doc/opencv-doc/examples/data";

struct Views {
  const char* indexed;
  const char* query;
};

constexpr Views kObjects[] = {{"graf1.png", "graf3.png"},
                              {"box.png", "box_in_scene.png"},
                              {"leuvenA.jpg", "leuvenB.jpg"},
                              {"aloeL.jpg", "aloeR.jpg"},
                              {"left.jpg", "right.jpg"},
                              {"Blender_Suzanne1.jpg", "Blender_Suzanne2.jpg"},
                              {"basketball1.png", "basketball2.png"},
                              {"rubberwhale1.png", "rubberwhale2.png"},
                              {"left01.jpg", "right01.jpg"}};
constexpr const char* kOthers[] = {"home.jpg",     "fruits.jpg", "baboon.jpg",      "butterfly.jpg",
                                   "building.jpg", "messi5.jpg", "starry_night.jpg"};

TEST(Photographs, AnotherViewFindsItsObjectFirst) {
  ASSERT_TRUE(std::filesystem::exists(kPhotographs / "graf1.png"))
      << "install Debian's package opencv-doc, as tests/run.sh does";
  const TemporaryFolder folder;
  const auto take = [&](const char* name) {
    std::filesystem::create_directories(folder / "pictures");
    std::filesystem::copy_file(kPhotographs / name, folder / "pictures" / name);
  };
  for (const Views& views : kObjects) take(views.indexed);
  for (const char* other : kOthers) take(other);
  const std::string db = (folder / "x.db").string();
  const ProgramResult indexed =
      RunProgram({"index", (folder / "pictures").string(), "--db", db, "--json"});
  ASSERT_EQ(indexed.status, 0) << indexed.err;
  EXPECT_EQ(indexed.json()["indexed"], std::size(kObjects) + std::size(kOthers));
  for (const Views& views : kObjects) {
    const ProgramResult found =
        RunProgram({"query", (kPhotographs / views.query).string(), "--db", db, "--json"});
    ASSERT_EQ(found.status, 0) << found.err;
    EXPECT_EQ(found.json()["hits"][0]["object"],
              std::filesystem::path(views.indexed).stem().string())
        << views.query << ": " << found.out;
  }
}

}  // namespace
}  // namespace pliant::testing
