// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A client that uploads, deletes and searches at random, and knows what it was told.
#pragma once

#include <atomic>
#include <map>
#include <random>
#include <set>
#include <string>

#include "tests/integration/server_process.h"

namespace pliant::testing {

inline constexpr unsigned kSeed = 20261121;
inline constexpr int kImages = 24;
inline constexpr const char* kSearch = "/v1/collections/default/search";

const std::string& MakeImage(int number);  // PNG, the same for numbers kImages apart
std::string ImagePath(const std::string& id);

// What a client knows of the ids that are its own: the number of the image, or that there is
// none.
struct Known {
  std::map<std::string, int> there;
  std::set<std::string> gone;
  std::set<std::string> unknown;  // asked for, never acknowledged

  void Put(const std::string& id, int image) {
    there[id] = image;
    gone.erase(id);
    unknown.erase(id);
  }
  void Delete(const std::string& id) {
    there.erase(id);
    gone.insert(id);
    unknown.erase(id);
  }
  void Forget(const std::string& id) {
    there.erase(id);
    gone.erase(id);
    unknown.insert(id);
  }
};

// Of all clients together.
struct Counts {
  std::atomic<int> done{0};
  std::atomic<int> refused{0};
};

class SoakClient {
 public:
  SoakClient(const ServerProcess& server, int number, Known& known, Counts& counts);

  // One client's life: until `stop`, or until the server does not answer. Returns what went wrong.
  std::string Live(const std::atomic<bool>& stop);

 private:
  enum class Outcome { kDone, kRefused, kOver };  // over: no answer, or wrong_ says why

  Outcome Put(const std::string& id, int image);
  Outcome Delete(const std::string& id);
  Outcome Search(int image);
  Outcome Forget(const std::string& id);  // there was no answer
  Outcome Complain(const std::string& what, const httplib::Result& answer);
  bool IsRefused(const httplib::Result& answer);  // then it has waited a moment

  httplib::Client client_;
  int number_;
  Known& known_;
  Counts& counts_;
  std::mt19937 random_;
  std::string wrong_;
};

}  // namespace pliant::testing
