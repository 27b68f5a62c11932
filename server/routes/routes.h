// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The route table, and the functions that fill it.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "server/http/parameters.h"
#include "server/http/router.h"
#include "server/routes/service.h"

namespace pliant::server {

using ServiceHandler = Response (*)(Service&, const Request&, const Parameters&);

// Collects routes. Add begins a route, and the calls chained to it describe it (see Route):
//   table.Add("GET /v1/aliases/{a}", "aliases.get", GetAlias)
//       .Summary("Get one alias")
//       .Answers(200, "the alias", "Alias");
// By default a GET needs the scope read, and other methods need write; a POST takes parameters as
// JSON, and other methods take no body; the example is the request alone, as curl sends it.
class RouteTable {
 public:
  // `service` must outlive the routes.
  explicit RouteTable(Service& service) : service_(service) {}

  RouteTable& Add(const std::string& route, const char* name, ServiceHandler handler) {
    return Add(route, name, Handler(std::bind_front(handler, std::ref(service_))));
  }
  RouteTable& Add(const std::string& route, const char* name, Handler handler) {
    const std::size_t space = route.find(' ');
    const std::string method = route.substr(0, space);
    routes_.push_back({.name = name,
                       .method = method,
                       .pattern = route.substr(space + 1),
                       .scope = method == "GET" ? Scope::kRead : Scope::kWrite,
                       .body = method == "POST" ? BodyKind::kJson : BodyKind::kNone,
                       .handler = std::move(handler)});
    return *this;
  }

  RouteTable& Summary(std::string text) { return Set(&Route::summary, std::move(text)); }
  RouteTable& Needs(Scope scope) { return Set(&Route::scope, scope); }
  RouteTable& Body(BodyKind body) { return Set(&Route::body, body); }
  RouteTable& Takes(std::vector<Parameter> parameters) {
    return Set(&Route::parameters, std::move(parameters));
  }
  // A merge patch; `schema` is the name of a component.
  RouteTable& Patches(std::string schema) {
    return Body(BodyKind::kMergePatch).Set(&Route::body_schema, std::move(schema));
  }
  RouteTable& TakesIfMatch() { return Set(&Route::takes_if_match, true); }
  RouteTable& WithoutIndex() { return Set(&Route::needs_index, false); }
  RouteTable& Receives(std::shared_ptr<BodySink> (*receive)(Service&, const Request&,
                                                            std::uint64_t body_bytes)) {
    return Set(&Route::receive, Receive(std::bind_front(receive, std::ref(service_))));
  }
  // Without a body.
  RouteTable& Answers(int status, const char* meaning) { return Sends("", meaning, status); }
  // JSON; `schema` is the name of a component.
  RouteTable& Answers(int status, const char* meaning, const char* schema) {
    routes_.back().answers.push_back({status, meaning, schema});
    return *this;
  }
  RouteTable& AnswersNotModified() { return Answers(304, "If-None-Match lists the current ETag"); }
  // A body of another type.
  RouteTable& Sends(const char* type, const char* meaning, int status = 200) {
    routes_.back().answers.push_back({status, meaning, "", type});
    return *this;
  }
  RouteTable& Codes(std::vector<std::string> codes) { return Set(&Route::codes, std::move(codes)); }
  RouteTable& Example(std::string command) { return Set(&Route::example, std::move(command)); }
  // A request with this JSON in its body; call it after Body() and Patches().
  RouteTable& ExampleBody(const std::string& json) {
    const bool is_patch = routes_.back().body == BodyKind::kMergePatch;
    return Example(std::string("-H \"Content-Type: application/") +
                   (is_patch ? "merge-patch+json" : "json") + "\" -d '" + json + "'");
  }

  std::vector<Route>& routes() { return routes_; }

 private:
  template <typename Field, typename Value>
  RouteTable& Set(Field field, Value value) {  // a pointer to a member of Route
    routes_.back().*field = std::move(value);
    return *this;
  }

  Service& service_;
  std::vector<Route> routes_;
};

// All routes. `service` must outlive them.
std::vector<Route> MakeRoutes(Service& service);

void AddServerRoutes(RouteTable& table);
void AddKeyRoutes(RouteTable& table);
void AddQrRoutes(RouteTable& table);
void AddPeerRoutes(RouteTable& table);
void AddCollectionRoutes(RouteTable& table);
void AddImageRoutes(RouteTable& table);
void AddImportRoutes(RouteTable& table);
void AddObjectRoutes(RouteTable& table);
void AddExportRoutes(RouteTable& table);
void AddSearchRoutes(RouteTable& table);
void AddCompareRoutes(RouteTable& table);
void AddVocabularyRoutes(RouteTable& table);
void AddJobRoutes(RouteTable& table);
void AddBackupRoutes(RouteTable& table);
// Last: the document describes all other routes.
void AddDocumentRoute(RouteTable& table);

// Adds Idempotency-Key to a handler. A client that does not know the outcome of its request sends
// the request again, and the server does not perform it twice
// (draft-ietf-httpapi-idempotency-key-header-07).
//
// Two requests are the same if method, path, query and body are. The parts of a form count one by
// one, since boundaries differ each time. The database remembers successful answers for a day, and
// any server on it replays them with the header Idempotency-Replayed. The server performs a request
// again that failed, or whose server died before it answered. Images that the dead server added are
// recognised by their bytes; only a job may start twice.
//
// Throws ProblemError "invalid_parameter" for an invalid key, "idempotency_running" while the first
// request runs, "idempotency_other" for a key of a different request. `service` must outlive it.
Handler Repeatable(Service& service, Handler handler);

}  // namespace pliant::server
