// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/results_json.h"

namespace pliant {

Json ResultsJson(const std::vector<evaluation::DescriptorResult>& results) {
  Json list = Json::array();
  for (const evaluation::DescriptorResult& r : results) {
    list.push_back({{"descriptor", r.label},
                    {"model_id", r.model_id},
                    {"pairs", r.pairs},
                    {"ms", r.ms},
                    {"ms_error", r.ms_error},
                    {"mma", r.mma},
                    {"mutual_precision", r.mutual_precision},
                    {"correct_matches", r.correct_matches},
                    {"ms_ratio_to_sift", r.ms_ratio_to_sift},
                    {"keypoints", r.keypoints},
                    {"true_pairs", r.true_pairs},
                    {"describe_us", r.describe_us}});
  }
  return list;
}

Json ResultJson(const RetrievalResult& row) {
  const RetrievalTimes& t = row.times;
  return {{"descriptor", row.descriptor},
          {"protocol", row.protocol},
          {"words", row.words},
          {"accuracy_at", row.mean.accuracy_at},
          {"map", row.mean.map},
          {"top1", row.mean.top1},
          {"mrr", row.mean.mrr},
          {"ns_score", OrNull(row.ns_score)},
          {"object_top1", row.object ? Json(row.object->top1) : Json(nullptr)},
          {"object_mrr", row.object ? Json(row.object->mrr) : Json(nullptr)},
          {"refused_queries", row.refused},
          {"found_right", row.mean.found_right},
          {"found_wrong", row.mean.found_wrong},
          {"absent_queries", row.absent.asked},
          {"false_alarms", row.absent.alarms},
          {"left_out_queries", row.left_out.asked},
          {"left_out_alarms", row.left_out.alarms},
          {"spread",
           {{"accuracy_at", row.spread.accuracy_at},
            {"map", row.spread.map},
            {"mrr", row.spread.mrr},
            {"ns_score", row.ns_score ? Json(row.spread.ns) : Json(nullptr)}}},
          {"seconds_per_query", t.total() / 1000},
          {"milliseconds",
           {{"decode", t.decode},
            {"detect", t.detect},
            {"describe", t.describe},
            {"quantize", t.quantize},
            {"rank", t.rank},
            {"verify", t.verify}}},
          {"bytes_per_image",
           {{"stored", row.stored_bytes_per_image}, {"index", row.index_bytes_per_image}}}};
}

}  // namespace pliant
