// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images that are written in one commit: all of them, or none.
#include <deque>

#include "descriptor/base/error.h"
#include "index/store/blob_codec.h"
#include "index/store/open_store.h"
#include "tests/unit/engine_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

// What is stored of image p1, to be stored again under other ids.
class PutAllTest : public EngineTest {
 protected:
  void SetUp() override {
    AddMany(engine_, 2);
    Train(engine_, 40);
    store_ = OpenStore({.database = Options().database, .create = false, .model_of_new = {}});
    store_->OpenOriginals(std::nullopt, false);
    store_->BeginWriting([] {});
    in_ = store_->catalogue().RequireCollection("default");
    const ImageRef ref{in_.key, "p1"};
    p1_ = store_->catalogue().LoadImages({&ref, 1}, Load::kRecordsAndFeatures).at(0).value();
  }

  void Ask(const std::string& id, ImageCheck check = {}) {
    AddRequest& request = requests_.emplace_back();
    request.id = id;
    request.object = "again";
    request.bytes = bytes_;
    ImagePut& put = puts_.emplace_back(ImagePut{.request = request});
    put.record = p1_.record;
    put.record.id = id;
    put.encoded = p1_.features;
    put.features = DecodeFeatures(p1_.features);
    put.check = std::move(check);
  }

  std::uint64_t images() { return engine_.GetCollection("default").images; }

  Engine engine_{Options()};
  const std::vector<std::uint8_t> bytes_ = RandomPng(1);
  std::unique_ptr<Store> store_;
  CollectionState in_;
  StoredImage p1_;
  std::deque<AddRequest> requests_;  // stay where they are
  std::vector<ImagePut> puts_;
};

TEST_F(PutAllTest, AllAreThereWithTheirWordsAndBytes) {
  Ask("c1");
  Ask("p2");  // is there, with other bytes
  Ask("c1");  // as the first one: what is done before in the same commit is seen
  const std::vector<PutOutcome> outcomes = store_->writer().PutAll(puts_);
  ASSERT_THAT(outcomes, SizeIs(3));
  EXPECT_EQ(outcomes[0].outcome, AddOutcome::kCreated);
  EXPECT_EQ(outcomes[1].outcome, AddOutcome::kReplaced);
  EXPECT_EQ(outcomes[2].outcome, AddOutcome::kUnchanged);
  EXPECT_EQ(images(), 3U);
  for (const char* id : {"c1", "p2"}) {
    EXPECT_EQ(engine_.Get("default", id).object, "again");
    EXPECT_EQ(engine_.GetContent("default", id), bytes_);
  }
  EXPECT_THAT(Ids(engine_.SearchStored("p1", ByImage())), ElementsAre("c1", "p1", "p2"));
}

TEST_F(PutAllTest, NoneIsThereWhereOneIsRefused) {
  Ask("c1");
  Ask("p1");
  Ask("c2", [](const ImageRecord*) { throw Error(ErrorCode::kConflict, "no", "not this one"); });
  ExpectError(ErrorCode::kConflict, "no", [&] { store_->writer().PutAll(puts_); });
  EXPECT_EQ(images(), 2U);
  EXPECT_EQ(engine_.Get("default", "p1").object, "o1");
  EXPECT_EQ(store_->writer().PutAll({puts_.data(), 1})[0].outcome, AddOutcome::kCreated);
  EXPECT_EQ(images(), 3U);
}

TEST_F(PutAllTest, NothingIsNoWork) {
  EXPECT_THAT(store_->writer().PutAll({}), SizeIs(0));
  EXPECT_EQ(images(), 2U);
}

}  // namespace
}  // namespace pliant::testing
