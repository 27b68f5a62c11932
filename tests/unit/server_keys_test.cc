// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// API keys and rate limits.
#include <chrono>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/auth/api_keys.h"
#include "server/auth/gate.h"

namespace pliant::server {
namespace {

using std::chrono::milliseconds;

TEST(ApiKeys, AreRandomAndHashed) {
  const NewKey first = MakeApiKey("a", Scope::kWrite);
  const NewKey second = MakeApiKey("a", Scope::kWrite);
  EXPECT_NE(first.key, second.key);
  EXPECT_NE(first.record.hash, second.record.hash);
  EXPECT_EQ(first.record.hash.size(), 64U);
  EXPECT_EQ(first.record.scope, "write");
  EXPECT_EQ(first.key.find(first.record.id), 4U);
}

TEST(RateLimiter, RefillsAndKeepsClientsApart) {
  RateLimiter limiter(2, 3);  // 2 a second, 3 at once
  auto now = RateLimiter::Clock::now();
  for (int i = 0; i < 3; ++i) EXPECT_EQ(limiter.Take("a", now).wait_s, 0);
  EXPECT_EQ(limiter.Take("a", now).wait_s, 1);
  EXPECT_EQ(limiter.Take("b", now).wait_s, 0);
  now += milliseconds(500);
  EXPECT_EQ(limiter.Take("a", now).wait_s, 0);
  EXPECT_EQ(limiter.Take("a", now).wait_s, 1);
  now += std::chrono::seconds(100);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(limiter.Take("a", now).wait_s, 0);
  EXPECT_GT(limiter.Take("a", now).wait_s, 0) << "no more than the burst is saved up";
  RateLimiter slow(0.1, 1);
  EXPECT_EQ(slow.Take("a", now).wait_s, 0);
  EXPECT_EQ(slow.Take("a", now).wait_s, 10);
  RateLimiter off(0, 1);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(off.Take("a", now).wait_s, 0);
}

TEST(RateLimiter, RemembersOnlySoMany) {
  RateLimiter limiter(1, 1);
  const auto now = RateLimiter::Clock::now();
  for (std::size_t i = 0; i < RateLimiter::kMaxBuckets; ++i) {
    EXPECT_EQ(limiter.Take(std::to_string(i), now).wait_s, 0);
  }
  EXPECT_EQ(limiter.Take("one more", now).wait_s, 1);
  EXPECT_EQ(limiter.Take("one more", now + std::chrono::seconds(2)).wait_s, 0)
      << "the others are full";
}

}  // namespace
}  // namespace pliant::server
