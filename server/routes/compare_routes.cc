// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Do two pictures show the same object?
#include <chrono>

#include "index/json/result_json.h"
#include "server/http/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response Compare(Service& service, const Request& request, const Parameters& parameters) {
  const auto start = std::chrono::steady_clock::now();
  const std::vector<UploadedImage> images = ImagesOf(request);
  if (images.size() == 1) {
    throw ProblemError("missing_parameter",
                       "Two pictures are required: the form field 'image' twice.")
        .Parameter("image");
  }
  if (images.size() > 2) {
    throw ProblemError("duplicate_parameter", "There are more than two form fields 'image'.")
        .Parameter("image");
  }
  Comparison comparison;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int cores) {
    comparison = service.engine().Compare(images[0].bytes, images[1].bytes, cores);
  });
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
  const bool explain = parameters.Flag("explain").value_or(false);
  return JsonResponse(ComparisonJson(comparison, took.count(), explain));
}

}  // namespace

void AddCompareRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "compare",
       .method = "POST",
       .pattern = "/v1/compare",
       .summary = "Do two pictures show the same object, and where is that of the first in the "
                  "second? Neither is stored",
       .body = BodyKind::kImages,
       .parameters = {Parameter("explain", "the matches that agree, and the warp")
                          .Boolean()
                          .Default("false")},
       .answers = {{200, "what the two have in common", "Comparison"}},
       .codes = {"missing_parameter", "image_type_unknown", "image_empty", "image_truncated",
                 "image_corrupt", "image_too_small", "image_too_large", "too_few_features"},
       .example = R"(curl -F image=@mug.png -F image=@cup.png "$PLIANT/v1/compare")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Compare(service, request, parameters);
       }});
}

}  // namespace pliant::server
