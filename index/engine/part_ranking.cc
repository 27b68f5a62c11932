// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/part_ranking.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <string_view>
#include <type_traits>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"

namespace pliant {

static_assert(std::endian::native == std::endian::little);

namespace {

using Clock = PartServers::Clock;

constexpr std::uint32_t kVersion = 3;  // of the messages
// Votes that are kept for a second step: the oldest go first.
constexpr std::size_t kMostKeptBytes = std::size_t{1} << 30U;
constexpr std::chrono::seconds kKeptFor{30};
// Attempts of a ranking while the parts change.
constexpr int kMostAttempts = 4;

void Require(bool valid, const char* what) {
  if (valid) return;
  throw Error(ErrorCode::kInvalidArgument, "peer_message_invalid",
              std::string("The message of the other server is invalid: ") + what +
                  ". All servers must run the same version.");
}

// Writes values one after the other, or reads them, so that one list of fields does both.
class Archive {
 public:
  Archive() { (*this)(version_); }
  explicit Archive(std::string_view message) : reads_(true), left_(message) {
    (*this)(version_);
    Require(version_ == kVersion, "its version");
  }
  std::string Text() && { return std::move(text_); }

  template <typename... Values>
  void operator()(Values&... values) {
    (Do(values), ...);
  }

 private:
  void Do(void* bytes, std::size_t size) {
    if (!reads_) {
      text_.append(static_cast<const char*>(bytes), size);
    } else if (size > 0) {
      Require(size <= left_.size(), "it is too short");
      std::memcpy(bytes, left_.data(), size);
      left_.remove_prefix(size);
    }
  }

  template <typename T>
    requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void Do(T& value) {
    Do(&value, sizeof(T));
  }
  void Do(bool& value) {
    char byte = value ? 1 : 0;
    Do(byte);
    value = byte != 0;
  }
  void Do(RankedImage& image) {
    (*this)(image.ref.version, image.object, image.score, image.ref.id);
    Require(!std::isnan(image.score), "a score");  // it has no place in an order
  }
  // Lists, and texts.
  template <typename List>
    requires requires(List list) { list.resize(0); }
  void Do(List& list) {
    using Value = typename List::value_type;
    std::size_t size = list.size();
    Do(size);
    if constexpr (std::is_trivially_copyable_v<Value>) {
      Require(!reads_ || size <= left_.size() / sizeof(Value), "it is too short");
      list.resize(size);
      Do(list.data(), size * sizeof(Value));
    } else {
      for (std::size_t i = 0; i < size; ++i) Do(reads_ ? list.emplace_back() : list[i]);
    }
  }

  std::uint32_t version_ = kVersion;
  bool reads_ = false;
  std::string_view left_;  // to read
  std::string text_;       // written
};

// What a search asks a server for.
struct Question {
  std::string token;
  std::string query;  // a Query; empty if the server keeps its votes
  // Of the second step.
  std::vector<std::string> digests = {};  // of the answers of the first step
  std::vector<std::uint32_t> voted = {};  // by all parts
  std::size_t candidates = 0;
};
void Fields(Archive& archive, Question& question) {
  archive(question.token, question.query, question.digests, question.voted, question.candidates);
}

struct Query {
  PartState state;
  RankQuery rank;
  RankOptions options;
};
void Fields(Archive& archive, Query& query) {
  auto& [state, rank, options] = query;
  archive(state.database, state.followed, state.name, state.collection, state.vocabulary);
  archive(rank.method, rank.descriptors.kind, rank.descriptors.dim, rank.descriptors.rows,
          rank.descriptors.floats, rank.descriptors.bytes, rank.weights, rank.words, rank.bow.words,
          rank.bow.total);
  Admission& admission = options.admission;
  archive(options.group_by, options.keep, options.min_score, admission.nothing,
          admission.without_versions);
  Key object = admission.object_key.value_or(-1);  // -1: any
  bool has_versions = admission.versions != nullptr;
  std::vector<Key> versions = has_versions ? *admission.versions : std::vector<Key>();
  archive(object, has_versions, versions);
  if (object != -1) admission.object_key = object;
  if (has_versions) {
    admission.versions = std::make_shared<const std::vector<Key>>(std::move(versions));
  }
}

// The answer of the first step.
struct Counts {
  std::vector<std::uint32_t> voted;
  std::size_t images = 0;
};
void Fields(Archive& archive, Counts& counts) { archive(counts.voted, counts.images); }

void Fields(Archive& archive, PartRanking& ranking) {
  archive(ranking.candidates, ranking.best, ranking.objects, ranking.alone);
}

template <typename T>
std::string Written(T value) {
  Archive archive;
  Fields(archive, value);
  return std::move(archive).Text();
}

template <typename T>
T ReadAs(std::string_view message) {
  Archive archive(message);
  T value{};
  Fields(archive, value);
  return value;
}

// For words and descriptors that the ranker would not find its way in.
void CheckQuery(const RankQuery& query, const Vocabulary& words) {
  const Descriptors& d = query.descriptors;
  const std::size_t values = d.kind == DescriptorKind::kBinary ? d.bytes.size() : d.floats.size();
  const bool fits = query.method == RankMethod::kHistogram ||
                    (d.kind == words.words.kind && d.dim == words.words.dim &&
                     values == d.rows * static_cast<std::size_t>(d.dim) &&
                     (query.weights.empty() || query.weights.size() == d.rows) &&
                     query.words.empty() == (d.rows == 0) &&
                     query.words.size() % std::max<std::size_t>(1, d.rows) == 0);
  const auto known = [&](const auto& entry) { return entry.word < words.size(); };
  Require(fits && std::ranges::all_of(query.words, known), "its descriptors");
  Require(std::ranges::all_of(query.bow.words, known), "its words");
}

// One attempt. Throws kUnavailable if a part has no server, kConflict if one has changed between
// the steps, and kInvalidArgument for answers of strangers.
Ranking RankOnce(PartServers& servers, const std::string& query, std::size_t rows,
                 const RankOptions& options, Clock::time_point until) {
  Question question{.token = RandomHex(32), .query = query};
  const PartServers::Replies counts = servers.Ask(Written(question), {}, {}, until);
  question.voted.resize(rows);
  std::size_t images = 0;
  std::string missing;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const auto& reply = counts[i];
    if (!reply) {
      missing += (missing.empty() ? "part " : ", ") + std::to_string(i + 1);
      continue;
    }
    const auto count = ReadAs<Counts>(reply->body);
    Require(count.voted.size() <= rows, "its votes");
    std::ranges::transform(count.voted, question.voted, question.voted.begin(), std::plus<>());
    images += count.images;
    question.digests.push_back(Sha256Hex(reply->body));
  }
  if (!missing.empty() && (!options.partial || question.digests.empty())) {
    throw Error(ErrorCode::kUnavailable, "part_unavailable",
                "No server answers for " + missing + " of the index.");
  }
  question.candidates = options.candidates ? options.candidates(images) : 0;
  const std::string whole = Written(question);
  question.query.clear();
  std::vector<PartRanking> parts;
  for (const auto& reply : servers.Ask(whole, Written(question), counts, until)) {
    if (reply) parts.push_back(ReadAs<PartRanking>(reply->body));
  }
  if (parts.size() < question.digests.size()) {
    throw Error(ErrorCode::kConflict, "part_changed", "A part of the index has changed.");
  }
  Ranking ranking = Merge(std::move(parts), question.candidates, options);
  ranking.searched =
      static_cast<double>(question.digests.size()) / static_cast<double>(counts.size());
  return ranking;
}

}  // namespace

Ranking RankInParts(const std::function<std::shared_ptr<PartServers>()>& servers,
                    const PartState& state, const RankQuery& query, const RankOptions& options) {
  const std::string message = Written(Query{state, query, options});
  std::shared_ptr<PartServers> asked = servers();
  const auto until = Clock::now() + asked->timeout();
  for (int attempt = 1;; ++attempt) {
    try {
      return RankOnce(*asked, message, query.descriptors.rows, options, until);
    } catch (const Error& error) {
      const std::shared_ptr<PartServers> now = servers();
      const bool is_missing = error.code() == ErrorCode::kUnavailable;
      if ((is_missing && now == asked) || attempt == kMostAttempts || Clock::now() >= until) {
        throw Error(ErrorCode::kUnavailable, "part_unavailable",
                    error.what() + std::string(" Try again shortly."));
      }
      asked = now;
    }
  }
}

// One part of one query, between its steps.
struct PartAnswers::Kept {
  std::string token;
  Query query;
  CollectionView view = {};
  std::unique_ptr<PartRanker> ranker = {};
  std::size_t bytes = 0;
  Clock::time_point since = Clock::now();
};

std::shared_ptr<PartAnswers::Kept> PartAnswers::Take(const std::string& token) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<Kept> taken;
  std::erase_if(kept_, [&](const auto& kept) {
    if (kept->token == token) taken = kept;
    return kept == taken;
  });
  if (taken) return taken;
  throw Error(ErrorCode::kNotFound, "part_elsewhere", "This server does not keep these votes.");
}

void PartAnswers::Keep(std::shared_ptr<Kept> kept) {
  const std::lock_guard lock(mutex_);
  kept_.push_front(std::move(kept));
  std::size_t bytes = 0;
  std::erase_if(kept_, [&, now = Clock::now()](const auto& one) {
    bytes += one->bytes;
    return bytes > kMostKeptBytes || now - one->since > kKeptFor;
  });
}

std::string PartAnswers::Answer(MemoryRanker& ranker, const std::string& database,
                                const std::string& message, int threads, Clock::time_point until) {
  if (Clock::now() >= until) {
    throw Error(ErrorCode::kUnavailable, "busy", "The other server does not wait any more.");
  }
  const auto question = ReadAs<Question>(message);
  std::shared_ptr<Kept> kept;
  if (question.query.empty()) {
    kept = Take(question.token);
  } else {
    kept = std::make_shared<Kept>(Kept{question.token, ReadAs<Query>(question.query)});
    const PartState& state = kept->query.state;
    if (state.database != database) {
      throw Error(ErrorCode::kNotFound, "part_elsewhere", "This server uses another database.");
    }
    if (auto view = ranker.ViewIn(state.vocabulary, state.name)) kept->view = *std::move(view);
    if (kept->view.collection != state.collection || !kept->view.has_vocabulary() ||
        ranker.followed() < state.followed) {
      throw Error(ErrorCode::kNotFound, "part_elsewhere",
                  "This server is not at the state of the database that was asked for.");
    }
    CheckQuery(kept->query.rank, kept->view.quantizer->vocabulary());
    kept->ranker = std::make_unique<PartRanker>(*kept->view.snapshot, *kept->view.quantizer,
                                                kept->query.rank, threads);
  }
  PartRanker& part = *kept->ranker;
  std::string counts = Written(Counts{part.voted(), kept->view.snapshot->images});
  if (question.digests.empty()) {
    kept->bytes = message.size() + sizeof(Vote) * std::reduce(part.voted().begin(),
                                                              part.voted().end(), std::size_t{0});
    Keep(kept);
    return counts;
  }
  if (std::ranges::find(question.digests, Sha256Hex(counts)) == question.digests.end()) {
    throw Error(ErrorCode::kConflict, "part_changed", "The part has changed between the steps.");
  }
  Require(question.voted.size() >= part.voted().size(), "its votes");
  kept->query.options.threads = threads;
  PartRanking ranking = part.Rank(question.voted, question.candidates, kept->query.options);
  std::ranges::sort(ranking.objects);
  return Written(std::move(ranking));
}

}  // namespace pliant
