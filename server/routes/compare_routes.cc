// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Do two images show the same object?
#include <array>
#include <memory>
#include <utility>

#include "descriptor/base/stopwatch.h"
#include "index/json/result_json.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/request_body.h"
#include "server/routes/routes.h"

namespace pliant::server {
namespace {

constexpr std::array<const char*, 2> kNames = {"first", "second"};
using Pair = std::array<UploadedImage, kNames.size()>;

// The images that `first` and `second` name; the form's fields 'image', in their order, take the
// place of absent parameters. Fetches only after both images are known.
Pair PairOf(const Request& request, const Parameters& parameters, Fetcher& fetcher) {
  std::vector<UploadedImage> uploaded = ImageParts(request);
  std::size_t taken = 0;
  Pair pair;
  for (std::size_t i = 0; i < pair.size(); ++i) {
    const ImageText* named = parameters.Image(kNames[i]);
    if (named != nullptr && named->base64) {
      pair[i] = ImageOfBase64(*named->base64, kNames[i]);
    } else if (named == nullptr && taken < uploaded.size()) {
      pair[i] = std::move(uploaded[taken++]);
    } else if (named == nullptr) {
      throw ProblemError("missing_parameter",
                         "Two images are required: form fields 'image', or 'first' and 'second', "
                         "each with image (base64) or image_url.",
                         {.parameter = request.is_multipart() ? "image" : kNames[i]});
    }
  }
  if (taken < uploaded.size()) {
    throw ProblemError("duplicate_parameter", "The request has more than two images. Send two.",
                       {.parameter = "image"});
  }
  // Both share one: a request that holds the first image must not wait for the second.
  std::shared_ptr<void> place;
  for (std::size_t i = 0; i < pair.size(); ++i) {
    const ImageText* named = parameters.Image(kNames[i]);
    if (named == nullptr || !named->url) continue;
    try {
      FetchedImage fetched = fetcher.Fetch(*named->url, Fetcher::For::kRequest, {}, place);
      place = fetched.place;
      pair[i] = ImageOfFetched(std::move(fetched));
    } catch (...) {
      Problem problem = CurrentProblem();
      if (problem.parameter == "image_url") problem.parameter = kNames[i];
      throw ProblemError(std::move(problem));
    }
  }
  return pair;
}

Response Compare(Service& service, const Request& request, const Parameters& parameters) {
  const Stopwatch watch;
  const Pair images = PairOf(request, parameters, service.fetcher);
  Comparison comparison;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int cores) {
    comparison = service.engine().Compare(images[0].bytes, images[1].bytes, cores);
  });
  return JsonResponse(ComparisonJson(comparison, watch.ms(), parameters.Value<bool>("explain")));
}

}  // namespace

void AddCompareRoutes(RouteTable& table) {
  table.Add("POST /v1/compare", "compare", Compare)
      .Summary(
          "Compare two images: whether they show the same object, and where it is in the second. "
          "The server stores neither image")
      .Needs(Scope::kRead)
      .Body(BodyKind::kPair)
      .Takes({Parameter("first", "the first image, unless a form field image has it").Image(),
              Parameter("second", "the second image, likewise").Image(),
              Parameter("explain", "add the inliers and the warp").Boolean().Default("false")})
      .Answers(200, "the comparison", "Comparison")
      .Example(R"(-F image=@mug.png -F image=@cup.png)");
}

}  // namespace pliant::server
