// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/part_ranking.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <type_traits>
#include <utility>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"

namespace pliant {

static_assert(std::endian::native == std::endian::little);

namespace {

using Json = nlohmann::json;
using Clock = PartServers::Clock;

constexpr int kVersion = 1;
// Votes that are kept for a second step: the oldest go first.
constexpr std::size_t kMostKeptBytes = std::size_t{1} << 30U;
constexpr std::chrono::seconds kKeptFor{30};
// Attempts of a ranking while the parts change.
constexpr int kMostAttempts = 4;

template <typename T>
Json Binary(const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(values.data());
  return Json::binary(std::vector<std::uint8_t>(bytes, bytes + values.size() * sizeof(T)));
}

[[noreturn]] void ThrowInvalid(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "peer_message_invalid",
              "The message of the other server is invalid: " + what +
                  ". All servers must run the same version.");
}

template <typename T>
std::vector<T> ListIn(const Json& message, const char* name) {
  const auto& bytes = message.at(name).get_binary();
  if (bytes.size() % sizeof(T) != 0) ThrowInvalid(name);
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

// The library reads nested values by recursion: a hostile message must not nest them deep.
class ShallowParser : public nlohmann::detail::json_sax_dom_parser<Json> {
  using Base = nlohmann::detail::json_sax_dom_parser<Json>;

 public:
  explicit ShallowParser(Json* json) : Base(*json, /*allow_exceptions=*/false) {}
  bool start_object(std::size_t size) { return IsShallow() && Base::start_object(size); }
  bool start_array(std::size_t size) { return IsShallow() && Base::start_array(size); }
  bool end_object() { return --depth_ >= 0 && Base::end_object(); }
  bool end_array() { return --depth_ >= 0 && Base::end_array(); }

 private:
  bool IsShallow() { return ++depth_ <= 3; }
  int depth_ = 0;
};

// Ascending numbers, as their differences: MessagePack writes small ones in a byte.
Json Ascending(const std::vector<std::int64_t>& numbers) {
  Json differences = Json::array();
  std::int64_t before = 0;
  for (const std::int64_t number : numbers)
    differences.push_back(number - std::exchange(before, number));
  return differences;
}

std::vector<std::int64_t> AscendingIn(const Json& message, const char* name) {
  auto numbers = message.at(name).get<std::vector<std::int64_t>>();
  std::partial_sum(numbers.begin(), numbers.end(), numbers.begin());
  return numbers;
}

Json Parsed(const std::string& message) {
  Json json;
  ShallowParser parser(&json);
  const bool read = Json::sax_parse(message, &parser, Json::input_format_t::msgpack);
  if (!read || !json.is_object() || json.value("version", 0) != kVersion) ThrowInvalid("its form");
  return json;
}

std::string Written(const Json& json) {
  std::string text;
  Json::to_msgpack(json, nlohmann::detail::output_adapter<char>(text));
  return text;
}

Json QueryJson(const DatabaseState& state, const CollectionView& view, const RankQuery& query,
               const RankOptions& options) {
  Json json = {{"version", kVersion},
               {"database", state.database},
               {"name", view.name},
               {"collection", view.collection},
               {"vocabulary", view.vocabulary},
               {"followed", state.followed},
               {"histogram", query.method == RankMethod::kHistogram},
               {"binary", query.descriptors.kind == DescriptorKind::kBinary},
               {"dim", query.descriptors.dim},
               {"rows", query.descriptors.rows},
               {"floats", Binary(query.descriptors.floats)},
               {"bytes", Binary(query.descriptors.bytes)},
               {"weights", Binary(query.weights)},
               {"near", Binary(query.words)},
               {"bow", Binary(query.bow.words)},
               {"total", query.bow.total},
               {"by_object", options.group_by == GroupBy::kObject},
               {"keep", options.keep},
               {"min_score", options.min_score},
               {"nothing", options.admission.nothing},
               {"without", Ascending(options.admission.without_versions)}};
  if (options.admission.object_key) json["object"] = *options.admission.object_key;
  if (options.admission.versions) json["versions"] = Ascending(*options.admission.versions);
  return json;
}

void ReadQuery(const Json& json, const Quantizer& quantizer, RankQuery* query,
               RankOptions* options) {
  Descriptors& d = query->descriptors;
  query->method =
      json.at("histogram").get<bool>() ? RankMethod::kHistogram : RankMethod::kNeighbours;
  d.kind = json.at("binary").get<bool>() ? DescriptorKind::kBinary : DescriptorKind::kFloat;
  d.dim = json.at("dim");
  d.rows = json.at("rows");
  d.floats = ListIn<float>(json, "floats");
  d.bytes = ListIn<std::uint8_t>(json, "bytes");
  query->weights = ListIn<float>(json, "weights");
  query->words = ListIn<NearWord>(json, "near");
  query->bow.words = ListIn<WordCount>(json, "bow");
  query->bow.total = json.at("total");
  const Vocabulary& words = quantizer.vocabulary();
  const std::size_t values = d.kind == DescriptorKind::kBinary ? d.bytes.size() : d.floats.size();
  const bool fits = query->method == RankMethod::kHistogram ||
                    (d.kind == words.words.kind && d.dim == words.words.dim &&
                     values == d.rows * static_cast<std::size_t>(d.dim) &&
                     (query->weights.empty() || query->weights.size() == d.rows) &&
                     (d.rows == 0 ? query->words.empty()
                                  : query->words.size() % d.rows == 0 && !query->words.empty()));
  const auto known = [&](const auto& entry) { return entry.word < words.size(); };
  if (!fits || !std::ranges::all_of(query->words, known) ||
      !std::ranges::all_of(query->bow.words, known)) {
    ThrowInvalid("its query");
  }
  options->group_by = json.at("by_object").get<bool>() ? GroupBy::kObject : GroupBy::kImage;
  options->keep = json.at("keep");
  options->min_score = json.at("min_score");
  options->admission.nothing = json.at("nothing");
  options->admission.without_versions = AscendingIn(json, "without");
  if (json.contains("object")) options->admission.object_key = json.at("object").get<Key>();
  if (json.contains("versions")) {
    options->admission.versions =
        std::make_shared<const std::vector<std::int64_t>>(AscendingIn(json, "versions"));
  }
}

std::string DigestOf(const std::vector<std::uint32_t>& voted) {
  return Sha256Hex(
      {reinterpret_cast<const char*>(voted.data()), voted.size() * sizeof(std::uint32_t)});
}

Json ImagesJson(const std::vector<RankedImage>& images) {
  Json list = Json::array();
  for (const RankedImage& image : images) {
    list.push_back({image.ref.version, image.object, image.score, image.ref.id});
  }
  return list;
}

std::vector<RankedImage> ImagesIn(const Json& list) {
  std::vector<RankedImage> images;
  for (const Json& image : list) {
    images.push_back({{0, image.at(3).get<std::string>(), image.at(0)}, image.at(1), image.at(2)});
  }
  return images;
}

using Replies = std::vector<std::optional<PartServers::Reply>>;

// "part 2, 3": those without a reply, unless the search does without them.
std::string MissingIn(const Replies& replies, bool partial) {
  std::string missing;
  for (std::size_t i = 0; i < replies.size(); ++i) {
    if (!replies[i]) missing += (missing.empty() ? "part " : ", ") + std::to_string(i + 1);
  }
  const bool any =
      std::ranges::any_of(replies, [](const auto& reply) { return reply.has_value(); });
  return partial && any ? "" : missing;
}

// One search's exchange with the parts.
class Exchange {
 public:
  Exchange(const DatabaseState& state, const CollectionView& view, const RankQuery& query,
           const RankOptions& options)
      : query_(query),
        options_(options),
        message_(QueryJson(state, view, query, options)),
        counting_(Written(message_)) {}

  // nullopt: a part has no server, or has changed between the steps; why() says which.
  std::optional<Ranking> Run(PartServers& servers, Clock::time_point until) {
    const Replies counts =
        servers.Ask([&]() -> const std::string& { return counting_; }, {}, {}, until);
    why_ = MissingIn(counts, options_.partial);
    if (!why_.empty()) return std::nullopt;
    std::vector<PartServers::Kept> kept(counts.size());
    std::vector<std::string> digests(counts.size());
    std::size_t images = 0;
    std::size_t answered = 0;
    std::vector<std::uint32_t> voted(query_.descriptors.rows);
    for (std::size_t i = 0; i < counts.size(); ++i) {
      if (!counts[i]) continue;
      const Json json = Parsed(counts[i]->body);
      const auto own = ListIn<std::uint32_t>(json, "voted");
      if (own.size() > voted.size()) ThrowInvalid("its votes");
      std::transform(own.begin(), own.end(), voted.begin(), voted.begin(), std::plus<>());
      images += json.at("images").get<std::size_t>();
      kept[i] = {counts[i]->server, json.at("token").get<std::string>()};
      digests[i] = DigestOf(own);
      ++answered;
    }
    const std::size_t candidates = options_.candidates ? options_.candidates(images) : 0;
    const Json sums = {{"version", kVersion}, {"voted", Binary(voted)}, {"candidates", candidates}};
    std::string whole;  // for servers without the votes
    const auto again = [&]() -> const std::string& {
      if (whole.empty()) {
        Json json = message_;
        json.update(sums);
        json["digests"] = digests;
        whole = Written(json);
      }
      return whole;
    };
    std::vector<PartRanking> parts;
    for (const auto& reply : servers.Ask(again, kept, Written(sums), until)) {
      if (!reply || reply->refused) continue;
      const Json json = Parsed(reply->body);
      parts.push_back({ImagesIn(json.at("candidates")), ImagesIn(json.at("best")),
                       AscendingIn(json, "objects"), json.at("alone")});
    }
    why_ = "a part that has changed";
    if (parts.size() < answered) return std::nullopt;
    Ranking ranking = Merge(std::move(parts), candidates, options_);
    ranking.searched = static_cast<double>(answered) / static_cast<double>(counts.size());
    return ranking;
  }
  const std::string& why() const { return why_; }

 private:
  const RankQuery& query_;
  const RankOptions& options_;
  const Json message_;
  const std::string counting_;
  std::string why_;
};

}  // namespace

Ranking RankInParts(const std::function<std::shared_ptr<PartServers>()>& servers,
                    const DatabaseState& state, const CollectionView& view, const RankQuery& query,
                    const RankOptions& options) {
  Exchange exchange(state, view, query, options);
  std::shared_ptr<PartServers> asked = servers();
  const auto until = Clock::now() + asked->timeout();
  std::string why;
  for (int attempt = 1; attempt <= kMostAttempts && Clock::now() < until; ++attempt) {
    try {
      if (auto ranking = exchange.Run(*asked, until)) return *std::move(ranking);
      why = exchange.why();
    } catch (const Json::exception& error) {
      why = std::string("a part whose answer is unreadable: ") + error.what();
    } catch (const Error& error) {
      why = std::string("a part whose answer is unreadable: ") + error.what();
    }
    const std::shared_ptr<PartServers> now = servers();
    if (now == asked && why.starts_with("part ")) break;
    asked = now;
  }
  throw Error(ErrorCode::kUnavailable, "part_unavailable",
              "No server answers for " + why + " of the index. Try again shortly.");
}

// One part of one query, between its steps.
struct PartAnswers::Kept {
  CollectionView view;
  RankQuery query;
  RankOptions options;
  std::optional<PartRanker> ranker;
  std::size_t bytes = 0;
  Clock::time_point since = Clock::now();
};

void PartAnswers::DropOld() {
  const auto drop = [&](auto entry) {
    kept_bytes_ -= entry->second->bytes;
    return kept_.erase(entry);
  };
  const auto now = Clock::now();
  for (auto entry = kept_.begin(); entry != kept_.end();) {
    entry = now - entry->second->since > kKeptFor ? drop(entry) : std::next(entry);
  }
  while (kept_bytes_ > kMostKeptBytes) {
    drop(
        std::ranges::min_element(kept_, {}, [](const auto& entry) { return entry.second->since; }));
  }
}

std::shared_ptr<PartAnswers::Kept> PartAnswers::Take(const std::string& token) {
  const std::lock_guard lock(mutex_);
  DropOld();
  const auto found = kept_.find(token);
  if (found == kept_.end()) {
    throw Error(ErrorCode::kNotFound, "part_elsewhere", "This server does not keep these votes.");
  }
  std::shared_ptr<Kept> kept = std::move(found->second);
  kept_.erase(found);
  kept_bytes_ -= kept->bytes;
  return kept;
}

std::string PartAnswers::Keep(std::shared_ptr<Kept> kept) {
  const std::string token = RandomHex(32);
  const std::lock_guard lock(mutex_);
  kept_bytes_ += kept->bytes;
  kept_.emplace(token, std::move(kept));
  DropOld();
  return token;
}

std::string PartAnswers::Answer(MemoryRanker& ranker, const std::string& database,
                                const std::string& token, const std::string& message, int threads,
                                Clock::time_point until) {
  const auto check_time = [&] {
    if (Clock::now() >= until) {
      throw Error(ErrorCode::kUnavailable, "busy", "The other server does not wait any more.");
    }
  };
  try {
    const Json json = Parsed(message);
    std::shared_ptr<Kept> kept;
    if (token.empty()) {
      if (json.at("database") != database) {
        throw Error(ErrorCode::kNotFound, "part_elsewhere", "This server uses another database.");
      }
      kept = std::make_shared<Kept>();
      auto view = ranker.ViewIn(json.at("vocabulary"), json.at("name"));
      if (view) kept->view = *std::move(view);
      if (kept->view.collection != json.at("collection").get<Key>() ||
          !kept->view.has_vocabulary() ||
          ranker.followed() < json.at("followed").get<std::int64_t>()) {
        throw Error(ErrorCode::kNotFound, "part_elsewhere",
                    "This server is not at the state of the database that was asked for.");
      }
      ReadQuery(json, *kept->view.quantizer, &kept->query, &kept->options);
      kept->options.threads = threads;
      check_time();
      kept->ranker.emplace(*kept->view.snapshot, *kept->view.quantizer, kept->query, threads);
    } else {
      kept = Take(token);
      kept->options.threads = threads;
    }
    PartRanker& part = *kept->ranker;
    if (!json.contains("voted")) {
      Json counts = {{"version", kVersion},
                     {"voted", Binary(part.voted())},
                     {"images", kept->view.snapshot->images}};
      kept->bytes = part.memory_bytes() + message.size();
      counts["token"] = Keep(std::move(kept));
      return Written(counts);
    }
    const auto voted = ListIn<std::uint32_t>(json, "voted");
    if (voted.size() < part.voted().size()) ThrowInvalid("its votes");
    if (token.empty()) {
      const auto digests = json.at("digests").get<std::vector<std::string>>();
      if (std::ranges::find(digests, DigestOf(part.voted())) == digests.end()) {
        throw Error(ErrorCode::kConflict, "part_changed",
                    "The part has changed between the steps.");
      }
    }
    check_time();
    PartRanking ranking = part.Rank(voted, json.at("candidates"), kept->options);
    std::ranges::sort(ranking.objects);
    return Written({{"version", kVersion},
                    {"candidates", ImagesJson(ranking.candidates)},
                    {"best", ImagesJson(ranking.best)},
                    {"objects", Ascending(ranking.objects)},
                    {"alone", ranking.alone}});
  } catch (const Json::exception& error) {
    ThrowInvalid(error.what());
  }
}

}  // namespace pliant
