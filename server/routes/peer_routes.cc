// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The part of the index that this server holds, for other servers (index/engine/index_parts.h). Not
// in the OpenAPI document: clients do not call it.
#include <algorithm>
#include <chrono>
#include <memory>

#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {
namespace {

Response Rank(Service& service, const Request& request, const Parameters& parameters) {
  const auto until = std::chrono::steady_clock::now() +
                     std::chrono::milliseconds(parameters.Value<int>("timeout_ms"));
  // As many threads serve other servers as there are cores: those share what is left.
  const int shared_by = ++service.parts_ranking;
  const auto end = [&service](void*) { --service.parts_ranking; };
  const std::unique_ptr<void, decltype(end)> running(&service, end);
  return {.content_type = kFileType,
          .body = service.engine().RankPart(
              {.part = parameters.Value<int>("part"), .parts = parameters.Value<int>("parts")},
              request.body, std::max(1, service.pool.cores() / shared_by), until)};
}

Response State(Service& service, const Request&, const Parameters&) {
  const IndexShare& share = service.options.engine.share;
  return JsonResponse({{"part", share.part},
                       {"parts", share.parts},
                       {"database", service.engine().database()},
                       {"followed", service.engine().followed()}});
}

}  // namespace

void AddPeerRoutes(RouteTable& table) {
  table.Add("GET /v1/peer", "peer.get", State).Needs(Scope::kPeer);
  table.Add("POST /v1/peer/rank", "peer.rank", Rank)
      .Needs(Scope::kPeer)
      .Body(BodyKind::kFile)
      .Takes({Parameter("part", "of the index").Integer(1, kMostParts).Required(),
              Parameter("parts", "that the index has").Integer(1, kMostParts).Required(),
              Parameter("timeout_ms", "after which the answer is not needed any more")
                  .Integer(1, 600'000)
                  .Default("5000")})
      .Codes({"part_elsewhere", "part_changed"});
}

}  // namespace pliant::server
