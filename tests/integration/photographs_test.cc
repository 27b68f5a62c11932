// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Real photographs of Debian's package opencv-doc: one view of each object is indexed, another view
// asks for it. With DEAL, through the real program.
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/image/image.h"
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

void ExpectPhotographs() {
  ASSERT_TRUE(std::filesystem::exists(kPhotographs / "graf1.png"))
      << "install Debian's package opencv-doc, as tests/run.sh does";
}

// The photograph in grey, its longer side with so many pixels.
Image Shrunk(const char* name, int side_px) {
  std::ifstream file(kPhotographs / name, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
  return DecodeImage(bytes, {.max_side_px = side_px}).image;
}

struct Scene {
  const char* print;
  int print_side_px;
  int side_px = 380;
  int left = 150;
  int top = 100;
};

// An aerial photograph in which a print lies.
void WriteScene(const Scene& wanted, const std::filesystem::path& path) {
  const Image photograph = Shrunk("aero1.jpg", 1024);
  Image scene = ResizeImage(photograph, wanted.side_px,
                            wanted.side_px * photograph.height / photograph.width);
  const Image small = Shrunk(wanted.print, wanted.print_side_px);
  for (int y = 0; y < small.height; ++y) {
    std::copy_n(small.pixels.begin() + static_cast<std::ptrdiff_t>(y) * small.width, small.width,
                scene.pixels.begin() + static_cast<std::ptrdiff_t>(wanted.top + y) * scene.width +
                    wanted.left);
  }
  const auto png = EncodePng(scene);
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
}

// A collection of prints, and a scene that is asked for them.
class PhotographsOfPrints : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(ExpectPhotographs());
    std::filesystem::create_directories(folder_ / "images");
    for (const char* name : {"sudoku.png", "cards.png", "graf1.png", "box.png", "fruits.jpg",
                             "baboon.jpg", "board.jpg", "starry_night.jpg"}) {
      std::filesystem::copy_file(kPhotographs / name, folder_ / "images" / name);
    }
    const ProgramResult indexed = RunProgram({"index", (folder_ / "images").string(), "--db", db_});
    ASSERT_EQ(indexed.status, 0) << indexed.err;
  }

  auto Ask(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"query", scene_, "--db", db_, "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult answer = RunProgram(arguments);
    EXPECT_EQ(answer.status, 0) << answer.err;
    return answer.json();
  }

  const TemporaryFolder folder_;
  const std::string db_ = (folder_ / "x.db").string();
  const std::string scene_ = (folder_ / "scene.png").string();
};

TEST(Photographs, AnotherViewFindsItsObjectFirst) {
  ASSERT_NO_FATAL_FAILURE(ExpectPhotographs());
  const TemporaryFolder folder;
  const auto take = [&](const char* name) {
    std::filesystem::create_directories(folder / "images");
    std::filesystem::copy_file(kPhotographs / name, folder / "images" / name);
  };
  for (const Views& views : kObjects) take(views.indexed);
  for (const char* other : kOthers) take(other);
  const std::string db = (folder / "x.db").string();
  const ProgramResult indexed =
      RunProgram({"index", (folder / "images").string(), "--db", db, "--json"});
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

// Too small to be found, but by a second description at a finer scale.
TEST_F(PhotographsOfPrints, ACloserLookFindsSmallPrints) {
  for (const auto& [print, side_px] : {std::pair{"sudoku.png", 64}, std::pair{"fruits.jpg", 44}}) {
    WriteScene({.print = print, .print_side_px = side_px}, scene_);
    const auto without = Ask({"--no-closer-look"});
    // Processors round differently: on some it is "perhaps".
    EXPECT_NE(without["verdict"], "found") << print << ": " << without.dump();
    EXPECT_EQ(without["looked_closer"], false);
    const auto closer = Ask({"--closer-look"});
    EXPECT_EQ(closer["verdict"], "found") << print << ": " << closer.dump();
    EXPECT_EQ(closer["looked_closer"], true);
    EXPECT_EQ(closer["hits"][0]["object"], std::filesystem::path(print).stem().string());
    EXPECT_GT(closer["keypoints"], without["keypoints"]);
  }
  WriteScene({.print = "graf1.png", .print_side_px = 120}, scene_);
  const auto at_once = Ask({"--closer-look"});
  EXPECT_EQ(at_once["verdict"], "found");
  EXPECT_EQ(at_once["looked_closer"], false) << "what is found at once is not described twice";
}

// A photograph of 3600 pixels has a print of 120: a thirtieth of it, of which the whole image
// shows 34 pixels, or 51 to a closer look; the part shows them all.
TEST_F(PhotographsOfPrints, APartIsSeenInItsOwnPixels) {
  for (const char* print : {"sudoku.png", "cards.png"}) {
    WriteScene({.print = print, .print_side_px = 120, .side_px = 3600, .left = 1500, .top = 1100},
               scene_);
    const auto whole = Ask({});
    EXPECT_NE(whole["verdict"], "found") << print << ": " << whole.dump();
    const auto part = Ask({"--region", "1480,1080,160,160"});
    EXPECT_EQ(part["verdict"], "found") << print << ": " << part.dump();
    EXPECT_EQ(part["query"]["width"], 3600);
    ASSERT_FALSE(part["hits"].empty());
    EXPECT_EQ(part["hits"][0]["object"], std::filesystem::path(print).stem().string());
    for (const auto& corner : part["hits"][0]["polygon"]) {
      EXPECT_NEAR(corner[0].get<double>(), 1560, 75) << "in pixels of the whole image";
      EXPECT_NEAR(corner[1].get<double>(), 1160, 75);
    }
  }
}

}  // namespace
}  // namespace pliant::testing
