// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests that an operation of the OpenAPI document must refuse, made of the document.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "tests/integration/openapi_fixture.h"

namespace pliant::testing {

// A request that shall be refused.
struct Wrong {
  std::string kind;  // what must not be missing for any operation: see MustHave
  std::string what, method, path, body, type;
  int status = 0;
  std::string code;
};

// All the wrong requests for one operation, which must outlive it.
class WrongRequests {
 public:
  // `path` is the operation's, filled; `filled` fills the places of a path that still has some.
  WrongRequests(const Operation& operation, std::string path,
                const std::function<std::string(std::string)>& filled);

  const std::vector<Wrong>& all() const { return wrong_; }

  // Kinds of faults that an operation of this form can meet.
  std::set<std::string> MustHave() const;

 private:
  void Add(const std::string& kind, const std::string& what, const std::string& at,
           const std::string& body, const std::string& type, int status, const std::string& code);
  // PUT makes what its path names last.
  bool Makes(const std::string& name) const;
  std::vector<std::string> RequiredFields() const;
  bool TakesAnyName() const;  // of the keys of its merge patch
  // The path with what must stand in its query: "/a", "/a?b=c".
  std::string WithRequired(const std::string& path) const;
  static std::string WithQuery(const std::string& path, const std::string& query);
  std::string GoodBody() const;
  void AddBodyFaults();
  void AddMissingFields();
  void AddPathFaults(const std::function<std::string(std::string)>& filled);
  void AddParameterFaults();
  void AddWrongTypes(const std::string& name, const std::string& type);
  // Any text will do, so that it is only wrong to give it twice.
  static bool IsText(const Json& parameter);

  const Operation& operation_;
  std::string path_;
  bool image_, json_, form_;
  std::string type_, body_;
  std::vector<Wrong> wrong_;
};

}  // namespace pliant::testing
