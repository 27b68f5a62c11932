// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A store for job queues, for the tests of jobs.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "index/engine/engine.h"
#include "index/store/open_store.h"
#include "server/jobs/job_runner.h"
#include "tests/support/eventually.h"
#include "tests/unit/index_test_images.h"

namespace pliant::server {

using pliant::testing::Eventually;
using pliant::testing::TemporaryFolder;
using std::chrono::milliseconds;

inline constexpr milliseconds kPatience{20'000};

inline JobKind Kind(std::function<std::string(const JobStatus&, const JobContext&)> run,
                    bool resumes = true) {
  return {std::move(run), resumes};
}

inline std::string UntilStopped(const JobStatus&, const JobContext& context) {
  while (!context.stop.stop_requested()) std::this_thread::sleep_for(milliseconds(1));
  throw Error(ErrorCode::kCancelled, "cancelled", "stopped");
}

// The jobs of a server.
class Jobs : public JobStore {
 public:
  explicit Jobs(ServiceStore& rows) : JobStore(rows), runner_(*this) {}
  void Register(const std::string& kind, JobKind how) { runner_.Register(kind, std::move(how)); }
  void Start() { runner_.Start(); }
  JobRunner& runner() { return runner_; }

 private:
  JobRunner runner_;
};

class JobsTest : public ::testing::Test {
 protected:
  JobsTest() {
    EngineOptions options;
    options.database = database();
    options.descriptor = "rootsift";
    const Engine made(options);
    store_ = OpenServiceStore(database());
  }
  std::filesystem::path database() { return folder_ / "x.db"; }

  TemporaryFolder folder_;
  std::unique_ptr<ServiceStore> store_;
};

}  // namespace pliant::server
