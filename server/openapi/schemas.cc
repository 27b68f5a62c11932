// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The schemas of answers and bodies (JSON Schema 2020-12). A test checks every answer of the
// examples against them.
#include <string>
#include <string_view>

#include "descriptor/base/strings.h"
#include "server/openapi/document.h"

namespace pliant::server {
namespace {

// By name, in a short form:
// - "TYPE: description". TYPE is a type of JSON, a key of kTypes below, or another schema's name.
//   "TYPE[]" is an array, "TYPE|null" can be null, "'a'|'b'" is one of these texts.
// - An object has its properties. "name?" is optional, "name[]" an array, "" the description of the
//   object, "..." the schema of other properties (or whether there can be any).
// - An array holds a schema in full.
constexpr const char* kSchemas = R"json({
  "Status": {"status": "string"},
  "Collection": {
    "name": "string", "display_name": "string|null: for people", "aliases": "string[]",
    "images": "integer", "objects": "integer", "descriptors": "integer: keypoints of all images",
    "vocabulary": "Vocabulary|null: the active one",
    "found_from": "share: a hit with this probability is found", "created_at": "time"},
  "CollectionList": {"collections": "Collection[]"},
  "CollectionPatch": {
    "": "a JSON merge patch (RFC 7396): absent keys stay as they are", "...": false,
    "display_name?": [{"type": ["string", "null"], "maxLength": 200,
      "description": "for people; null: the collection's name"}],
    "found_from?": [{"type": ["number", "null"], "minimum": 0.5, "maximum": 0.99,
      "description": "a hit with this probability is found; null: 0.9"}]},
  "OutcomeShare": {"": "of the photos, with its interval of 95 %", "count": "integer",
    "share": "share", "low": "share", "high": "share"},
  "SelfTest": {"report": "SelfTestReport|null"},
  "SelfTestReport": {
    "made_at": "time", "seconds": "number", "images": "integer: of the collection",
    "photos": "integer: simulated photos",
    "outcomes": {"found": "OutcomeShare", "perhaps": "OutcomeShare: among the first three hits",
      "missed": "OutcomeShare", "wrong": "OutcomeShare: another object is found",
      "false_alarms": "OutcomeShare: something is found although the object is taken out"},
    "by_strength[]": {"strength": "share: of the deformation", "photos": "integer",
      "found": "OutcomeShare|null"},
    "by_size[]": {"": "by the object's width", "from": "share: of the photo's width", "to": "share",
      "photos": "integer", "found": "OutcomeShare|null"},
    "false_alarm_rate": "share: as requested",
    "found_from": "share: the advised found_from of the collection",
    "reaches_rate": "boolean: false: even 0.99 has more false alarms, or the photos are too few",
    "similar[]": {"": "pairs of objects that are too similar", "object": "string|null",
      "image_id": "string", "other": "string|null", "other_image": "string",
      "confused": "integer: number of photos of one that were found as the other"},
    "plain[]": {"": "images with few keypoints", "object": "string|null", "image_id": "string",
      "keypoints": "integer"},
    "missed[]": {"object": "string|null", "image_id": "string", "photos": "integer",
      "missed": "integer"},
    "examples[]": {"object": "string|null", "image_id": "string",
      "verdict": "'found'|'perhaps'|'missed'|'wrong'", "probability": "share",
      "strength": "share", "size": "share: width of the object in the photo",
      "photo": "string: base64 of a JPEG"}},
  "Alias": {"name": "string", "collection": "string", "updated_at": "time: of the last move"},
  "AliasList": {"aliases": "Alias[]"},
  "AliasesPatch": {
    "": "a JSON merge patch (RFC 7396): the collection of each alias; null removes the alias",
    "...": "string|null"},
  "Image": {
    "id": "string", "collection": "string", "object": "string: of the image, or empty",
    "metadata": "any", "source": "string: the file name or URL that the client gave, or empty",
    "sha256": "string: of the uploaded bytes", "media_type": "string",
    "bytes": "integer: size of the upload", "width": "integer", "height": "integer",
    "keypoints": "integer", "added_at": "time: when these bytes were added",
    "updated_at": "time: of the last change of bytes, object, metadata or source"},
  "ImagePatch": {
    "": "a JSON merge patch (RFC 7396): absent keys stay as they are", "...": false,
    "object?": "string|null: the object that the image shows; null or empty: none",
    "metadata?": "any|null: keys to set; a null value removes the key, null removes all keys",
    "source?": "string|null: the file name, for people",
    "collection?": "string: moves the image there, with its features"},
  "ImageList": {"images": "Image[]", "next": "string|null: cursor of the next page",
    "total?": "integer: with count: over all pages", "facets?": "Facets"},
  "ImagesDeleted": {"deleted": "integer"},
  "Facets": {"": "by key of the metadata, most frequent values first", "...": {
    "values[]": {"": "at most 100", "count": "integer",
      "value": [{"type": ["string", "number", "boolean", "null"]}]},
    "without": "integer: number of images without the key",
    "complete": "boolean: false: there are more values"}},
  "Features": {
    "width": "integer", "height": "integer", "model_id": "string",
    "keypoints[]": {"x": "number: in pixels of the upright image", "y": "number",
      "size": "number", "angle": "number: in degrees, clockwise", "response": "number"},
    "descriptors": {"type": "'float32'|'uint8'", "rows": "integer", "dim": "integer",
      "base64": "string: little-endian, row by row"}},
  "Object": {"object": "string", "images": "integer", "image_id": "string|null: one of its images"},
  "ObjectList": {"objects": "ListedObject[]", "next": "string|null: cursor of the next page",
    "total?": "integer: with count: over all pages", "facets?": "Facets"},
  "ListedObject": {
    "object": "string", "images": "integer", "image_id": "string|null: one of its images",
    "created_at": "time: of its oldest image",
    "updated_at": "time: of the last change of one of its images"},
  "ObjectPatch": {"...": false, "object?": [{"type": "string", "minLength": 1,
    "description": "the new name"}],
    "collection?": "string: moves all images of the object there, in one transaction"},
  "ObjectDeleted": {"object": "string", "deleted": "integer"},
  "Location": {
    "object": "string", "image_id": "string|null: the best-matching image", "took_ms": "number",
    "width": "integer", "height": "integer", "compared": "integer: number of compared images",
    "...": true},
  "Demo": {"loaded": "boolean", "objects[]": {"object": "string", "image_id": "string",
    "crumpled": "string: address of a photo of the crumpled object"}},

  "SearchAnswer": {
    "took_ms": "number", "rank": "'neighbours'|'histogram': the ranking",
    "vocabulary": "integer: its number", "words": "integer: size of the vocabulary",
    "keypoints": "integer: of the query, inside the region",
    "looked_closer": "boolean: the server made a second pass at high resolution (closer_look)",
    "mirrored": "boolean: the photo shows the first hit mirrored",
    "query": "QueryImage|null: null with image_ids",
    "examples[]?": {"": "with image_ids", "image_id": "string", "keypoints": "integer",
      "width": "integer", "height": "integer"},
    "total": "integer: number of hits over all pages",
    "searched": "number: share of the index that was searched: 1, or less with partial=true",
    "verdict": "'found'|'perhaps'|'not_found'|null: perhaps: the first hit has a probability of 0.2 or more",
    "found": "integer|null: number of hits as likely as the collection's found_from",
    "hits": "Hit[]", "timings": {"...": "number"}},
  "SearchBatchAnswer": {
    "failed": "integer: number of searches with a problem",
    "results[]": {"index": "integer", "status": "integer: an HTTP status",
      "answer?": "SearchAnswer", "problem?": "ProblemSummary"}},
  "Hit": {
    "rank": "integer: from 1, over all pages", "object": "string|null: null: the image has none",
    "score": "share",
    "probability": "share|null: that the hit is right; null if not verified or with histogram",
    "verdict": "'found'|'perhaps'|'unlikely'|null: found: as likely as the collection's found_from; perhaps: 0.2 or more",
    "image_id": "string: the object's best image",
    "source": "string: its file name, or empty",
    "inliers": "integer: matches that fit one smooth warp",
    "polygon": "points|null: outline of the object in the photo",
    "instances[]?": {"inliers": "integer", "polygon": "points|null"},
    "example?": "string: with image_ids: the best-matching example; all positions are in it",
    "metadata": "any", "explain?": "Explanation"},
  "Size": {"": "of the upright image, in pixels", "width": "integer", "height": "integer"},
  "QueryImage": {"": "size of the upright photo, in pixels", "width": "integer",
    "height": "integer", "preview?": "string: with preview: the photo as a JPEG in a data: URL"},
  "Explanation": {
    "ranking_score": "number: score before the verification", "verified": "boolean",
    "failure": "string|null: why the verification failed", "matches": "integer",
    "inlier_fraction": "number",
    "independent_inliers": "number: the effective inlier count: nearby inliers share one count",
    "colour_difference": "number|null: mean, in CIELAB a* and b*, corrected for the light",
    "appearance": "Appearance|null: what the pixels say; null without strong evidence",
    "pairs": "points: x and y in the query, x and y in the hit", "reference": "Size|null",
    "mesh": "any|null: the warp: positions in the query of a grid over the hit's image"},
  "Appearance": {
    "seen_again": "share: of the hit's texture that the query shows again",
    "colour_difference": "number|null: relative to the strength of the colours"},
  "ComparedImage": {"width": "integer", "height": "integer", "keypoints": "integer"},
  "Comparison": {
    "took_ms": "number",
    "verdict": "'found'|'perhaps'|'not_found': found: the probability is 0.9 or more; perhaps: 0.2 or more",
    "probability": "share: that both images show the same object",
    "first": "ComparedImage", "second": "ComparedImage",
    "matches": "integer: pairs of similar keypoints",
    "inliers": "integer: matches that fit one smooth warp", "inlier_fraction": "number",
    "polygon": "points|null: outline of the first image's object in the second image",
    "failure": "string|null: why no warp was found", "timings": {"...": "number"},
    "explain?": "Explanation"},
  "Vocabulary": {
    "id": "integer", "words": "integer", "active": "boolean", "model_id": "string",
    "method": "string", "seed": "integer", "sampled": "integer: descriptors used for training",
    "available": "integer: descriptors of the collection at that time", "loss": "number",
    "created_at": "time"},
  "VocabularyList": {"vocabularies": "Vocabulary[]"},

  "Me": {"keys_required": "boolean: false: anyone can do everything",
    "scopes": "Scope[]: what the caller can do",
    "key": "CallerKey|null: null if the server requires no key",
    "image_url": "boolean: whether the server fetches images from some hosts",
    "backups": "boolean: whether the server has a directory for backups"},
  "Scope": "'read'|'write'|'admin'|'peer'",
  "CallerKey": {"id": "string: public, as in the log", "name": "string", "scope": "Scope"},
  "ApiKey": {"id": "string: public, as in the log", "name": "string", "scope": "Scope",
    "created_at": "time", "revoked_at": "time|null: null: the key is valid"},
  "KeyList": {"keys": "ApiKey[]"},
  "NewKey": [{"allOf": [{"$ref": "#/components/schemas/ApiKey"},
    {"type": "object", "required": ["key"], "properties": {
      "key": {"type": "string", "description": "the key itself, shown only here"}}}]}],
  "Problem": {
    "type": [{"type": "string", "format": "uri"}], "title": "string", "status": "integer",
    "code": "string: for programs", "detail": "string: for people", "request_id": "string",
    "parameter?": "string: the parameter at fault",
    "image_id?": "string: with same_bytes: the image with these bytes",
    "object?": "string: with same_bytes: the object of that image",
    "progress?": "number: with starting: the loaded share of the index"},
  "ProblemSummary": {"code": "string", "detail": "string", "parameter?": "string"},
  "Backup": {"name": "string", "bytes": "integer", "created_at": "time"},
  "BackupList": {"backups": "Backup[]"},
  "Job": {
    "id": "string", "kind": "string", "collection": "string",
    "state": "'queued'|'running'|'done'|'failed'|'cancelled'",
    "done": "number: of total", "total": "number", "failed": "integer: number of failed items",
    "system_files": "integer: files in folders of systems (trash, thumbnails), which an import left out",
    "attempts": "integer: number of starts", "created_at": "time", "finished_at": "time|null",
    "parameters": "any",
    "skipped[]?": {"": "the first 100 skipped items", "item": "string", "code": "string",
      "reason": "string"},
    "result?": "string: address of the result", "problem?": "ProblemSummary"},
  "JobList": {"jobs": "Job[]", "next": "string|null: cursor of the next page"},
  "JobItems": {
    "items[]": {"index": "integer: from 0, in the order of the body",
      "source": "string: the file name, or the line's number",
      "status": "integer: an HTTP status", "outcome?": "'created'|'replaced'|'unchanged'|'changed'",
      "image_id?": "string", "object?": "string", "problem?": "ProblemSummary"},
    "next": "string|null: cursor of the next page"}
})json";

constexpr const char* kTypes = R"json({
  "time": {"type": "string", "format": "date-time"},
  "share": {"type": "number", "minimum": 0, "maximum": 1},
  "points": {"type": "array", "items": {"type": "array", "items": {"type": "number"}}},
  "any": {"type": "object", "additionalProperties": true}
})json";

Json TypeSchema(const std::string& type) {
  static const Json types = Json::parse(kTypes);
  if (type.ends_with("[]")) {
    return {{"type", "array"}, {"items", TypeSchema(type.substr(0, type.size() - 2))}};
  }
  if (type < "a") return {{"$ref", "#/components/schemas/" + type}};  // begins with a capital
  return types.value(type, Json{{"type", type}});
}

Json TextSchema(std::string_view text) {
  const std::size_t colon = text.find(": ");
  Json schema;
  Json choices = Json::array();
  bool nullable = false;
  for (const std::string& type : Split(text.substr(0, colon), '|')) {
    if (type == "null") {
      nullable = true;
    } else if (type.front() == '\'') {
      choices.push_back(type.substr(1, type.size() - 2));
    } else {
      schema = TypeSchema(type);
    }
  }
  if (!choices.empty()) {
    if (nullable) choices.push_back(nullptr);
    schema["enum"] = std::move(choices);
  } else if (nullable && schema.contains("type")) {
    schema["type"] = {schema["type"], "null"};
  } else if (nullable) {
    schema = {{"oneOf", {std::move(schema), {{"type", "null"}}}}};
  }
  if (colon != std::string_view::npos) schema["description"] = text.substr(colon + 2);
  return schema;
}

Json SchemaOf(const Json& brief) {
  if (brief.is_string()) return TextSchema(brief.get<std::string>());
  if (brief.is_array()) return brief.front();
  if (brief.is_boolean()) return brief;
  Json schema = {{"type", "object"}};
  for (const auto& [key, value] : brief.items()) {
    if (key.empty()) {
      schema["description"] = value;
    } else if (key == "...") {
      schema["additionalProperties"] = SchemaOf(value);
    } else {
      std::string name = key;
      const bool required = !name.ends_with('?');
      if (!required) name.pop_back();
      const bool array = name.ends_with("[]");
      if (array) name.resize(name.size() - 2);
      Json& property = schema["properties"][name] = SchemaOf(value);
      if (array) {
        property = {{"type", "array"}, {"items", property}};
        if (value.contains("")) property["description"] = value[""];
      }
      if (required) schema["required"].push_back(name);
    }
  }
  return schema;
}

}  // namespace

Json OpenApiSchemas() {
  Json schemas = Json::object();
  const Json brief = Json::parse(kSchemas);
  for (const auto& [name, value] : brief.items()) schemas[name] = SchemaOf(value);
  return schemas;
}

}  // namespace pliant::server
