// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What `pliant describe --out x.h5` writes, read by HDF5's own library, and compared with what it
// writes as .safetensors.
#include <csignal>
#include <cstring>
#include <map>
#include <thread>

#include <gmock/gmock.h>
#include <hdf5.h>

#include "descriptor/base/safetensors.h"
#include "tests/integration/cli_fixture.h"

namespace pliant::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;

struct Dataset {
  std::vector<hsize_t> shape;
  std::vector<float> values;  // whatever the type in the file
  H5T_class_t type = H5T_NO_CLASS;
  std::size_t bytes = 0;  // of a value in the file
};

// Every dataset of a file, by its path.
class Hdf5Content {
 public:
  explicit Hdf5Content(const fs::path& path)
      : file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT)) {
    EXPECT_GE(file_, 0) << path;
    EXPECT_GE(H5Lvisit(file_, H5_INDEX_NAME, H5_ITER_INC, Visit, this), 0);
  }
  ~Hdf5Content() { H5Fclose(file_); }

  std::string Text(const char* attribute) const {
    const hid_t id = H5Aopen(file_, attribute, H5P_DEFAULT);
    const hid_t type = H5Aget_type(id);
    char* text = nullptr;
    EXPECT_GE(H5Aread(id, type, static_cast<void*>(&text)), 0);
    std::string copy = text == nullptr ? "" : text;
    H5free_memory(text);
    H5Tclose(type);
    H5Aclose(id);
    return copy;
  }
  std::vector<std::string> Pictures() const {
    std::vector<std::string> names;
    for (const auto& [path, dataset] : datasets) {
      if (path.ends_with("/keypoints")) names.push_back(path.substr(0, path.rfind('/')));
    }
    return names;
  }

  std::map<std::string, Dataset> datasets;

 private:
  static herr_t Visit(hid_t file, const char* name, const H5L_info_t* /*info*/, void* self) {
    const hid_t id = H5Oopen(file, name, H5P_DEFAULT);
    if (H5Iget_type(id) != H5I_DATASET) return H5Oclose(id);
    const hid_t space = H5Dget_space(id);
    const hid_t type = H5Dget_type(id);
    Dataset dataset;
    dataset.shape.resize(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space)));
    H5Sget_simple_extent_dims(space, dataset.shape.data(), nullptr);
    dataset.type = H5Tget_class(type);
    dataset.bytes = H5Tget_size(type);
    dataset.values.resize(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
    EXPECT_GE(H5Dread(id, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, dataset.values.data()),
              0);
    H5Tclose(type);
    H5Sclose(space);
    H5Dclose(id);
    static_cast<Hdf5Content*>(self)->datasets[name] = std::move(dataset);
    return 0;
  }

  hid_t file_;
};

class DescribeHdf5Test : public CliTest {
 protected:
  ProgramResult Describe(const fs::path& what, const fs::path& out, const std::string& descriptor,
                         const ProgramLimits& limits = {}) {
    return RunProgram({"describe", what.string(), "--descriptor", descriptor, "--max-keypoints",
                       "60", "--out", out.string(), "--json"},
                      limits);
  }
  // What is in the folder of the test beside `objects`.
  std::vector<std::string> Files() {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      if (entry.path() != objects_) names.push_back(entry.path().filename());
    }
    return names;
  }
};

TEST_F(DescribeHdf5Test, HoldsWhatTheOtherFormatsHold) {
  WriteObjects(3);
  WriteBytes(folder_ / "objects" / "at the top.png", RandomPng(9));
  WriteBytes(folder_ / "objects" / "o1" / "M\u00FCtze.png", RandomPng(10));
  for (const std::string descriptor : {"rootsift", "orb"}) {
    const fs::path out = folder_ / (descriptor + ".h5");
    const ProgramResult result = Describe(objects_, out, descriptor);
    ASSERT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(result.json()["images"], 5);
    EXPECT_EQ(result.json()["skipped"], Json::array());
    const Hdf5Content content(out);
    EXPECT_THAT(content.Pictures(),
                UnorderedElementsAre("at the top.png", "o1/M\u00FCtze.png", "o1/view.png",
                                     "o2/view.png", "o3/view.png"));
    EXPECT_EQ(content.Text("model_id"), result.json()["model_id"]);
    EXPECT_THAT(content.Text("generator"), StartsWith("Pliant "));
    const fs::path alone = folder_ / "alone.safetensors";
    ASSERT_EQ(Describe(folder_ / "objects" / "o2" / "view.png", alone, descriptor).status, 0);
    std::map<std::string, Tensor> expected;
    for (Tensor& tensor : ReadSafetensors(alone)) expected[tensor.name] = std::move(tensor);
    const Tensor& points = expected.at("keypoints");
    const Tensor& rows = expected.at("descriptors");
    const auto n = static_cast<std::size_t>(points.shape[0]);
    const auto dim = static_cast<std::size_t>(rows.shape[1]);
    ASSERT_GT(n, 10U);
    const auto get = [&](const std::string& name) {
      return content.datasets.at("o2/view.png/" + name);
    };
    const Dataset keypoints = get("keypoints");
    const Dataset descriptors = get("descriptors");
    EXPECT_THAT(keypoints.shape, ElementsAre(n, 2));
    EXPECT_THAT(descriptors.shape, ElementsAre(dim, n));
    EXPECT_EQ(descriptors.type, descriptor == "orb" ? H5T_INTEGER : H5T_FLOAT);
    EXPECT_EQ(descriptors.bytes, descriptor == "orb" ? 1U : 4U);
    EXPECT_THAT(get("image_size").values, ElementsAre(160.F, 120.F));
    for (std::size_t i = 0; i < n; ++i) {
      float point[6];  // x, y, size, angle, response, octave
      std::memcpy(point, points.bytes.data() + i * sizeof point, sizeof point);
      EXPECT_EQ(keypoints.values[2 * i], point[0]);
      EXPECT_EQ(keypoints.values[2 * i + 1], point[1]);
      EXPECT_EQ(get("scales").values.at(i), point[2] / 2);
      EXPECT_EQ(get("oris").values.at(i), point[3]);
      EXPECT_EQ(get("scores").values.at(i), point[4]);
      for (std::size_t d = 0; d < dim; ++d) {
        float value = 0;
        const std::size_t at = i * dim + d;
        if (descriptor == "orb") {
          value = rows.bytes[at];
        } else {
          std::memcpy(&value, rows.bytes.data() + at * sizeof value, sizeof value);
        }
        ASSERT_EQ(descriptors.values[d * n + i], value);
      }
    }
  }
}

TEST_F(DescribeHdf5Test, OnePictureAndOddNames) {
  WriteBytes(folder_ / "q.png", RandomPng(1));
  ASSERT_EQ(Describe(folder_ / "q.png", folder_ / "one.hdf5", "orb").status, 0);
  EXPECT_THAT(Hdf5Content(folder_ / "one.hdf5").Pictures(), ElementsAre("q.png"));
  WriteBytes(folder_ / "objects" / "bad\xFF.png", RandomPng(2));          // no UTF-8
  WriteBytes(folder_ / "objects" / "bad\\xff.png", RandomPng(3));         // named as that is shown
  WriteBytes(folder_ / "objects" / "keypoints" / "a.png", RandomPng(4));  // as a dataset
  WriteBytes(folder_ / "objects" / "f\\xff" / "b.png", RandomPng(5));
  WriteBytes(folder_ / "objects" / "empty.png", {});
  const ProgramResult result = Describe(objects_, folder_ / "odd.h5", "orb");
  EXPECT_EQ(result.status, 3) << result.err;
  EXPECT_EQ(result.json()["images"], 3);
  std::vector<std::string> codes;
  const Json skipped_ones = result.json()["skipped"];
  for (const Json& skipped : skipped_ones) codes.push_back(skipped["code"]);
  EXPECT_THAT(codes, ::testing::Contains("name_taken")) << result.out;
  EXPECT_EQ(codes.size(), 2U);
  EXPECT_THAT(Hdf5Content(folder_ / "odd.h5").Pictures(),
              ElementsAre("bad\\xff.png", "f\\xff/b.png", "keypoints/a.png"));
}

TEST_F(DescribeHdf5Test, WhatCannotBeWrittenLeavesWhatWasThere) {
  WriteObjects(3);
  const fs::path out = folder_ / "x.h5";
  ASSERT_EQ(Describe(objects_, out, "rootsift").status, 0);
  const std::vector<std::uint8_t> before = ReadBytes(out);
  const ProgramResult full =
      Describe(objects_, out, "rootsift", {.max_file_bytes = before.size() / 2});
  EXPECT_EQ(full.status, 1);
  EXPECT_EQ(full.json()["error"]["code"], "write_failed");
  EXPECT_THAT(full.err, HasSubstr("File too large"));
  EXPECT_EQ(ReadBytes(out), before);
  EXPECT_THAT(Files(), ElementsAre("x.h5"));
  fs::create_directory(folder_ / "no.h5");
  for (const fs::path& wrong : {folder_ / "none" / "x.h5", folder_ / "no.h5"}) {
    const ProgramResult result = Describe("/no such picture", wrong, "rootsift");
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(result.json()["error"]["code"], "write_failed") << "said before anything is read";
  }
  fs::permissions(folder_.path(), fs::perms(0555));
  EXPECT_EQ(Describe(objects_, folder_ / "y.h5", "orb", {.unprivileged = true}).status, 1);
  fs::permissions(folder_.path(), fs::perms(0755));
  fs::create_directory(folder_ / "objects" / "none");
  EXPECT_EQ(Describe(folder_ / "objects" / "none", out, "rootsift").status, 1);
  EXPECT_EQ(ReadBytes(out), before);
}

TEST_F(DescribeHdf5Test, InterruptedLeavesNothing) {
  for (std::uint64_t i = 0; i < 400; ++i) {
    WriteBytes(folder_ / "objects" / (std::to_string(i) + ".png"), RandomPng(i));
  }
  Program program({"describe", objects_, "--descriptor", "rootsift", "--jobs", "1", "--out",
                   (folder_ / "x.h5").string()});
  const auto begun = [&] { return !Files().empty(); };
  while (!begun() && program.IsRunning()) std::this_thread::yield();
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait().status, 130);
  EXPECT_TRUE(Files().empty());
}

}  // namespace
}  // namespace pliant::testing
