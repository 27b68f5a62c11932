// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Do two pictures show the same object?
#include <array>
#include <memory>
#include <utility>

#include "descriptor/base/stopwatch.h"
#include "index/json/result_json.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"
#include "server/routes/uploaded_image.h"

namespace pliant::server {

namespace {

constexpr std::array<const char*, 2> kNames = {"first", "second"};
using Pair = std::array<UploadedImage, kNames.size()>;

// What is said of image_url is said of the picture that has it.
[[noreturn]] void ThrowFor(const char* name) {
  Problem problem = CurrentProblem();
  if (problem.parameter == "image_url") problem.parameter = name;
  throw ProblemError(std::move(problem));
}

std::vector<UploadedImage> Uploaded(const Request& request) {
  const bool none = std::none_of(request.parts.begin(), request.parts.end(),
                                 [](const Part& part) { return part.name == "image"; });
  return none ? std::vector<UploadedImage>() : ImagesOf(request);
}

// The pictures that are named by `first` and `second`, and in the places of those that are not, the
// form's fields 'image' in their order. Nothing is fetched before all of it is there.
Pair PairOf(const Request& request, const Parameters& parameters, Fetcher& fetcher) {
  std::vector<UploadedImage> uploaded = Uploaded(request);
  std::size_t taken = 0;
  Pair pair;
  for (std::size_t i = 0; i < pair.size(); ++i) {
    const PictureText* named = parameters.Picture(kNames[i]);
    if (named != nullptr && named->base64) {
      pair[i] = ImageOfBase64(*named->base64, kNames[i]);
    } else if (named == nullptr && taken < uploaded.size()) {
      pair[i] = std::move(uploaded[taken++]);
    } else if (named == nullptr) {
      throw ProblemError("missing_parameter",
                         "Two pictures are required: form fields 'image', or 'first' and 'second', "
                         "each with image (base64) or image_url.")
          .Parameter(request.is_multipart() ? "image" : kNames[i]);
    }
  }
  if (taken < uploaded.size()) {
    throw ProblemError("duplicate_parameter", "There are more than two pictures.")
        .Parameter("image");
  }
  std::shared_ptr<void> place;  // one for both: a request that waits for its second helps nobody
  for (std::size_t i = 0; i < pair.size(); ++i) {
    const PictureText* named = parameters.Picture(kNames[i]);
    if (named == nullptr || !named->url) continue;
    try {
      FetchedPicture fetched = fetcher.Fetch(*named->url, Fetcher::For::kRequest, {}, place);
      place = fetched.place;
      const Bytes bytes(*fetched.bytes);
      pair[i] = {bytes, std::move(fetched.source), std::move(fetched.bytes)};
    } catch (...) {
      ThrowFor(kNames[i]);
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
  const bool explain = parameters.Flag("explain").value_or(false);
  return JsonResponse(ComparisonJson(comparison, watch.ms(), explain));
}

}  // namespace

void AddCompareRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "compare",
       .method = "POST",
       .pattern = "/v1/compare",
       .summary = "Do two pictures show the same object, and where is that of the first in the "
                  "second? Neither is stored",
       .body = BodyKind::kPair,
       .parameters =
           {Parameter("first", "the first picture, where it is no form field image").Picture(),
            Parameter("second", "likewise the second").Picture(),
            Parameter("explain", "the matches that agree, and the warp")
                .Boolean()
                .Default("false")},
       .answers = {{200, "what the two have in common", "Comparison"}},
       .example = R"(curl -F image=@mug.png -F image=@cup.png "$PLIANT/v1/compare")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Compare(service, request, parameters);
       }});
}

}  // namespace pliant::server
