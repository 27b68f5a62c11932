// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/adding.h"

namespace pliant::server {

AddResult AddOnPool(Service& service, const AddRequest& request, const ImageCheck& check) {
  // A store that cannot be written now must not keep cores from searches.
  std::function<AddResult()> write;
  service.pool.Run(WorkerPool::Lane::kUpload, [&](int cores) {
    AddRequest with_cores = request;
    with_cores.threads = cores;
    write = service.engine().BeginAdd(with_cores, check);
  });
  AddResult result = write();
  if (result.outcome != AddOutcome::kUnchanged) {
    service.metrics.OnAdd(result.timings);
    if (service.auto_trainer() != nullptr) service.auto_trainer()->OnAdded(request.collection);
  }
  return result;
}

Parameter ObjectParameter() { return {"object", "what the image shows"}; }

Parameter MetadataParameter() {
  return Parameter("metadata", "a JSON object that is kept with the image").Json();
}

}  // namespace pliant::server
