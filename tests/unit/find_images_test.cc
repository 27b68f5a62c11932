// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which files of folders are images, and what their objects are called.
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "index/files/image_files.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

class FindImagesTest : public ::testing::Test {
 protected:
  FindImagesTest() {
    std::string name = (fs::temp_directory_path() / "pliant-find-XXXXXX").string();
    root_ = ::mkdtemp(name.data());
  }
  ~FindImagesTest() override { fs::remove_all(root_); }

  void Put(const std::string& name) {
    fs::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << "by its name";
  }

  // Objects by the files' ways from the root.
  std::map<std::string, std::string> Named(const std::vector<std::string>& inputs,
                                           ObjectFrom object_from = ObjectFrom::kAuto) {
    std::vector<fs::path> paths;
    for (const std::string& input : inputs) paths.push_back(root_ / input);
    std::map<std::string, std::string> objects;
    for (const ImageFile& file : FindImages(paths, object_from).images) {
      objects[file.path.lexically_relative(root_).string()] = file.object;
    }
    return objects;
  }

  fs::path root_;
};

using Names = std::map<std::string, std::string>;

TEST_F(FindImagesTest, AFolderForEachObject) {
  for (const char* name : {"shop/coat/1.jpg", "shop/coat/2.jpg", "shop/hat/1.png"}) Put(name);
  EXPECT_EQ(
      Named({"shop"}),
      (Names{{"shop/coat/1.jpg", "coat"}, {"shop/coat/2.jpg", "coat"}, {"shop/hat/1.png", "hat"}}));
  EXPECT_EQ(Named({"shop/coat", "shop/hat"}), Named({"shop"}));
}

TEST_F(FindImagesTest, FoldersOfOneNameInDifferentPlacesAreDifferentObjects) {
  for (const char* name : {"coat/front/x.jpg", "coat/back/x.jpg", "hat/front/y.jpg"}) Put(name);
  const Names ways = {{"coat/front/x.jpg", "coat/front"},
                      {"coat/back/x.jpg", "coat/back"},
                      {"hat/front/y.jpg", "hat/front"}};
  EXPECT_EQ(Named({""}), ways);
  EXPECT_EQ(Named({""}, ObjectFrom::kFolder), ways);
}

TEST_F(FindImagesTest, WhatLiesBesideFoldersIsNamedByItsFile) {
  for (const char* name : {"shop/red.jpg", "shop/blue.jpg"}) Put(name);
  const Names flat = {{"shop/blue.jpg", "blue"}, {"shop/red.jpg", "red"}};
  EXPECT_EQ(Named({"shop"}), flat);
  Put("shop/hat/1.jpg");  // what was there keeps its name
  EXPECT_EQ(Named({"shop"}),
            (Names{{"shop/blue.jpg", "blue"}, {"shop/hat/1.jpg", "hat"}, {"shop/red.jpg", "red"}}));
  const ImageFiles files = FindImages({root_ / "shop"}, ObjectFrom::kAuto);
  EXPECT_TRUE(files.by_folder && files.by_stem);
  EXPECT_EQ(Named({"shop/red.jpg", "shop/blue.jpg", "shop/hat"}),  // as of shop/*
            (Names{{"shop/blue.jpg", "blue"}, {"shop/hat/1.jpg", "hat"}, {"shop/red.jpg", "red"}}));
  EXPECT_EQ(Named({"shop"}, ObjectFrom::kFolder)["shop/red.jpg"], "shop");
  EXPECT_EQ(Named({"shop"}, ObjectFrom::kStem)["shop/hat/1.jpg"], "1");
  EXPECT_EQ(Named({"shop"}, ObjectFrom::kNone)["shop/hat/1.jpg"], "");
}

TEST_F(FindImagesTest, FoldersOfSystemsAreLeftOutAndCounted) {
  for (const char* name :
       {"shop/obj/a.jpg", "shop/@eaDir/SYNOPHOTO_THUMB_XL.jpg", "shop/obj/@eaDir/a.jpg/SYNO_M.jpg",
        "shop/#recycle/old.jpg", "shop/@Recycle/x.jpg", "shop/$RECYCLE.BIN/x.jpg",
        "shop/lost+found/x.jpg", "shop/__MACOSX/obj/._a.jpg", "shop/System Volume Information/x",
        "shop/.hidden/@eaDir/x.jpg", "shop/recycle/kept.jpg"}) {
    Put(name);
  }
  const Names kept = {{"shop/obj/a.jpg", "obj"}, {"shop/recycle/kept.jpg", "recycle"}};
  EXPECT_EQ(Named({"shop"}), kept);
  EXPECT_EQ(FindImages({root_ / "shop"}, ObjectFrom::kAuto).system_files, 8U);
  EXPECT_EQ(Named({"shop/#recycle"}), (Names{{"shop/#recycle/old.jpg", "old"}})) << "if asked for";
}

TEST_F(FindImagesTest, ALinkNamesAnObjectOnlyIfNothingElseDoes) {
  for (const char* name : {"shop/obj/a.jpg", "outside/b.jpg", "outside/c.jpg"}) Put(name);
  fs::create_directories(root_ / "shop/links");
  fs::create_symlink("..", root_ / "shop/links/loop");
  fs::create_symlink("../obj", root_ / "shop/links/again");
  fs::create_symlink("../obj/a.jpg", root_ / "shop/links/a.jpg");
  fs::create_symlink("../../outside/b.jpg", root_ / "shop/links/b.jpg");
  fs::create_symlink("nowhere.jpg", root_ / "shop/links/broken.jpg");
  EXPECT_EQ(Named({"shop"}), (Names{{"shop/links/b.jpg", "links"}, {"shop/obj/a.jpg", "obj"}}));
  const ImageFiles files = FindImages({root_ / "shop"}, ObjectFrom::kAuto);
  ASSERT_EQ(files.skipped.size(), 1U);
  EXPECT_TRUE(files.skipped[0].file.ends_with("links/broken.jpg"));
  fs::create_symlink("../outside", root_ / "shop/z");  // a folder is more of a name than a link
  EXPECT_EQ(Named({"shop"}),
            (Names{{"shop/obj/a.jpg", "obj"}, {"shop/z/b.jpg", "z"}, {"shop/z/c.jpg", "z"}}));
}

}  // namespace
}  // namespace pliant
