// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabularies that are trained without being asked, and those that they must leave alone.
#include <chrono>
#include <memory>

#include <gtest/gtest.h>

#include "index/store/open_store.h"
#include "server/jobs/training.h"
#include "tests/unit/index_test_images.h"

namespace pliant::server {
namespace {

using pliant::testing::RandomPng;
using pliant::testing::TemporaryFolder;

constexpr std::chrono::milliseconds kTrainingTime{60'000};

class TrainerTest : public ::testing::Test {
 protected:
  TrainerTest() { Start(); }
  ~TrainerTest() override { Stop(); }

  void Start() {
    EngineOptions options;
    options.database = folder_ / "x.db";
    options.descriptor = "rootsift";
    engine_ = std::make_unique<Engine>(options);
    store_ = OpenServiceStore(options.database);
    jobs_ = std::make_unique<JobStore>(*store_);
    runner_ = std::make_unique<JobRunner>(*jobs_);
    RegisterVocabularyJobs(*runner_, *engine_, pool_);
    runner_->Start();
    trainer_ = std::make_unique<AutoTrainer>(*engine_, *jobs_);
    trainer_->Stop();  // it is asked by the test, not by time
  }
  void Stop() {
    trainer_.reset();
    runner_.reset();
    jobs_.reset();
    store_.reset();
    engine_.reset();
  }

  void AddImages(int count) {
    for (; count > 0; --count) {
      const auto png = RandomPng(next_++);
      AddRequest request;
      request.bytes = png;
      engine_->Add(request);
    }
  }
  // Whether a vocabulary was due; then it is in use.
  bool Train() {
    const auto job = trainer_->TrainIfDue(kDefaultCollection);
    if (!job) return false;
    EXPECT_TRUE(jobs_->WaitFor(job->id, kTrainingTime));
    EXPECT_EQ(jobs_->Get(job->id).state, JobState::kDone);
    return true;
  }
  std::int64_t Active() { return engine_->Stats().vocabulary->id; }

  TemporaryFolder folder_;
  WorkerPool pool_{{.cores = 2}};
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<ServiceStore> store_;
  std::unique_ptr<JobStore> jobs_;
  std::unique_ptr<JobRunner> runner_;
  std::unique_ptr<AutoTrainer> trainer_;
  std::uint64_t next_ = 1;
};

TEST_F(TrainerTest, TrainsAgainWhenThereIsMuchMore) {
  EXPECT_FALSE(Train()) << "no images";
  AddImages(1);
  EXPECT_TRUE(Train());
  EXPECT_EQ(Active(), 1);
  AddImages(1);
  EXPECT_FALSE(Train()) << "not enough more";
  AddImages(4);
  Stop();
  Start();
  EXPECT_TRUE(Train()) << "what an earlier run of the server trained is its own";
  EXPECT_EQ(Active(), 2);
}

TEST_F(TrainerTest, LeavesAChosenVocabularyAlone) {
  AddImages(1);
  EXPECT_TRUE(Train());
  engine_->UseVocabulary(kDefaultCollection, 1);  // it is in use already: now because it was chosen
  AddImages(5);
  EXPECT_FALSE(Train());
  Stop();
  Start();
  EXPECT_FALSE(Train()) << "also after a restart";
  EXPECT_EQ(Active(), 1);
}

TEST_F(TrainerTest, LeavesAnEarlierVocabularyAloneThatIsChosenAgain) {
  AddImages(1);
  EXPECT_TRUE(Train());
  AddImages(5);
  EXPECT_TRUE(Train());
  EXPECT_EQ(Active(), 2);
  engine_->UseVocabulary(kDefaultCollection, 1);
  AddImages(1);
  EXPECT_FALSE(Train());
  EXPECT_EQ(Active(), 1);
}

TEST_F(TrainerTest, LeavesAVocabularyAloneThatSomebodyTrained) {
  AddImages(1);
  TrainOptions options;
  options.seed = AutoTrainer::kSeed;  // the seed does not tell who did it
  const JobStatus job = AddTrainingJob(*jobs_, options, /*activate=*/true);
  ASSERT_TRUE(jobs_->WaitFor(job.id, kTrainingTime));
  EXPECT_EQ(Active(), 1);
  AddImages(5);
  EXPECT_FALSE(Train());
}

TEST_F(TrainerTest, AutomaticTrainingThatIsNoLongerDueTrainsNothing) {
  AddImages(1);
  EXPECT_TRUE(Train());
  TrainOptions options;
  options.automatic = true;  // as another server queued it before this one's was done
  const JobStatus job = AddTrainingJob(*jobs_, options, /*activate=*/true);
  ASSERT_TRUE(jobs_->WaitFor(job.id, kTrainingTime));
  EXPECT_EQ(jobs_->Get(job.id).state, JobState::kDone);
  EXPECT_EQ(jobs_->Get(job.id).result, "/v1/collections/default/vocabularies/1");
  EXPECT_EQ(engine_->ListVocabularies(kDefaultCollection).size(), 1U);
}

}  // namespace
}  // namespace pliant::server
