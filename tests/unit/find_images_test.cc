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

}  // namespace
}  // namespace pliant
