// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/soak_client.h"

#include <chrono>
#include <cstdlib>
#include <thread>
#include <vector>

namespace pliant::testing {
namespace {

// Busy, and it says so: with a code, and when to come again. Anything else is wrong.
bool IsHonestRefusal(const httplib::Response& answer) {
  if (answer.status != 503 && answer.status != 429) return false;
  const Json problem = Json::parse(answer.body, nullptr, false);
  const std::string code = problem.is_object() ? problem.value("code", "") : "";
  return std::atoi(answer.get_header_value("Retry-After").c_str()) > 0 &&
         (code == "busy" || code == "starting" || code == "rate_limited");
}

}  // namespace

const std::string& MakeImage(int number) {
  static const std::vector<std::string> images = [] {
    std::vector<std::string> made;
    for (int i = 0; i < kImages; ++i) made.push_back(TestImage(i));
    return made;
  }();
  return images[static_cast<std::size_t>(number) % images.size()];
}

std::string ImagePath(const std::string& id) { return "/v1/collections/default/images/" + id; }

SoakClient::SoakClient(const ServerProcess& server, int number, Known& known, Counts& counts)
    : client_(server.Client()),
      number_(number),
      known_(known),
      counts_(counts),
      random_(kSeed + static_cast<unsigned>(number)) {}

std::string SoakClient::Live(const std::atomic<bool>& stop) {
  while (!stop) {
    const std::string id = "c" + std::to_string(number_) + "-" + std::to_string(random_() % 6);
    const int image = static_cast<int>(random_() % kImages);
    const unsigned what = random_() % 10;
    const Outcome outcome = what < 5 ? Put(id, image) : what < 7 ? Delete(id) : Search(image);
    if (outcome == Outcome::kOver) return wrong_;
    if (outcome == Outcome::kDone) ++counts_.done;
  }
  return "";
}

SoakClient::Outcome SoakClient::Put(const std::string& id, int image) {
  const auto answer = client_.Put(ImagePath(id) + "?object=o" + std::to_string(image),
                                  MakeImage(image), "image/png");
  if (!answer) return Forget(id);
  if (IsRefused(answer)) return Outcome::kRefused;
  if (answer->status != 200 && answer->status != 201) return Complain("PUT", answer);
  known_.Put(id, image);
  return Outcome::kDone;
}

SoakClient::Outcome SoakClient::Delete(const std::string& id) {
  const bool expected = known_.there.contains(id);
  const bool certain = !known_.unknown.contains(id);
  const auto answer = client_.Delete(ImagePath(id));
  if (!answer) return Forget(id);
  if (IsRefused(answer)) return Outcome::kRefused;
  const bool as_expected = answer->status == (expected ? 204 : 404);
  if (certain ? !as_expected : answer->status != 204 && answer->status != 404) {
    return Complain("DELETE", answer);
  }
  known_.Delete(id);
  return Outcome::kDone;
}

SoakClient::Outcome SoakClient::Search(int image) {
  const auto answer = client_.Post(kSearch, MakeImage(image), "image/png");
  if (!answer) return Outcome::kOver;
  if (IsRefused(answer)) return Outcome::kRefused;
  // 409: nobody has uploaded anything yet.
  if (answer->status != 200 && answer->status != 409) return Complain("search", answer);
  return Outcome::kDone;
}

SoakClient::Outcome SoakClient::Forget(const std::string& id) {
  known_.Forget(id);
  return Outcome::kOver;
}

SoakClient::Outcome SoakClient::Complain(const std::string& what, const httplib::Result& answer) {
  wrong_ = what + " was answered " + std::to_string(answer->status) + " " + answer->body;
  return Outcome::kOver;
}

bool SoakClient::IsRefused(const httplib::Result& answer) {
  if (!IsHonestRefusal(*answer)) return false;
  ++counts_.refused;
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  return true;
}

}  // namespace pliant::testing
