// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What an engine decides, and when; and engines where hardly a file can be opened.
#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

class EngineOpeningTest : public EngineTest {
 protected:
  // An indexed image has no more keypoints than the limit says.
  EngineOptions Plain() {
    EngineOptions options = Options();
    options.enlarge = false;
    return options;
  }
  // As it is opened by who may never describe an image.
  EngineOptions Lazy() {
    EngineOptions options = Plain();
    options.load_descriptor = false;
    return options;
  }
};

TEST_F(EngineOpeningTest, LimitsAreWrittenDownWithTheFirstImage) {
  EngineOptions options = Lazy();
  options.max_keypoints = 70;
  Engine engine(options);
  Engine(Lazy()).ListCollections();  // looking decides nothing
  Add(engine, RandomPng(1), "o1", "p1");
  EXPECT_LE(engine.GetFeatures("default", "p1").keypoints.size(), 70U);
  EngineOptions other = Plain();
  other.max_keypoints = 200;
  ExpectError(ErrorCode::kConflict, "extraction_mismatch", [&] { Engine{other}; });
  Engine follower(Plain());
  Add(follower, RandomPng(2), "o2", "p2");
  EXPECT_LE(follower.GetFeatures("default", "p2").keypoints.size(), 70U);
}

TEST_F(EngineOpeningTest, AnotherEngineMayDecideFirst) {
  Engine follows(Lazy());
  EngineOptions insisting = Lazy();
  insisting.max_keypoints = 300;
  Engine insists(insisting);
  EngineOptions first = Plain();
  first.max_keypoints = 60;
  Engine decides(first);
  Add(follows, RandomPng(1), "o1", "p1");
  EXPECT_LE(follows.GetFeatures("default", "p1").keypoints.size(), 60U);
  ExpectError(ErrorCode::kConflict, "extraction_mismatch",
              [&] { Add(insists, RandomPng(2), "o2", "p2"); });
}

// Takes all files but so many that this process may open.
class FewFiles {
 public:
  explicit FewFiles(std::size_t left) {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    rlimit few = before_;
    few.rlim_cur = 128;
    ::setrlimit(RLIMIT_NOFILE, &few);
    for (int file = 0; (file = ::open("/dev/null", O_RDONLY | O_CLOEXEC)) >= 0;) {
      taken_.push_back(file);
    }
    for (; left > 0 && !taken_.empty(); --left) {
      ::close(taken_.back());
      taken_.pop_back();
    }
  }
  ~FewFiles() {
    for (const int file : taken_) ::close(file);
    ::setrlimit(RLIMIT_NOFILE, &before_);
  }
  FewFiles(const FewFiles&) = delete;
  FewFiles& operator=(const FewFiles&) = delete;

 private:
  rlimit before_{};
  std::vector<int> taken_;
};

// How often `work` is refused with 0, 1, 2 ... files left, before it is done.
template <typename Work>
int RefusalsUntilDone(Work work) {
  for (std::size_t left = 0; left < 40; ++left) {
    try {
      const FewFiles few(left);
      work();
      return static_cast<int>(left);
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "too_many_open_files") << left << ": " << error.what();
      EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
    }
  }
  ADD_FAILURE() << "never done";
  return 40;
}

TEST_F(EngineOpeningTest, WithoutFilesToOpenItSaysSo) {
  EngineOptions options = Options();
  options.originals_dir = folder_ / "originals";
  {
    Engine engine(options);
    Add(engine, RandomPng(1), "o1", "p1");
  }
  EXPECT_GT(RefusalsUntilDone([&] { Engine{options}; }), 2);
  Engine engine(options);
  EXPECT_GT(RefusalsUntilDone([&] { Add(engine, RandomPng(2), "o2", "p2"); }), 0);
  EXPECT_GT(RefusalsUntilDone([&] { engine.GetContent("default", "p2"); }), 0);
  EXPECT_EQ(engine.GetContent("default", "p2"), RandomPng(2)) << "what was added is whole";
  engine.SweepOriginals();
  EXPECT_TRUE(engine.Check().empty());
}

}  // namespace
}  // namespace pliant::testing
