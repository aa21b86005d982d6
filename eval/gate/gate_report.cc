#include "eval/gate/gate_report.h"

#include <algorithm>

#include "core/files.h"
#include "core/json_text.h"

namespace tsdfpp {
namespace {

std::string Value(const GateOutcome& outcome) {
  const Judgement& judgement = outcome.judgement;
  if (!judgement.mean.value) return "-";
  if (!judgement.interval.value) return fmt::format("{:.4g}", *judgement.mean.value);
  return fmt::format("{:.4g} [{:.4g}, {:.4g}]", *judgement.mean.value,
                     judgement.interval.value->low, judgement.interval.value->high);
}

// What the value is: "metric", "metric - reference", "metric / that of method tsdf".
std::string What(const Gate& gate) {
  const char* sign = gate.ratio ? "/" : "-";
  switch (gate.kind) {
    case Gate::Kind::kAbsolute:
      return gate.metric;
    case Gate::Kind::kReference:
      return fmt::format("{} {} reference", gate.metric, sign);
    case Gate::Kind::kPaired:
      return fmt::format("{} {} that of {}", gate.metric, sign, ChoiceText(gate.against));
  }
  std::abort();
}

std::string Change(const GateOutcome& outcome) {
  if (outcome.gate.kind != Gate::Kind::kReference || !outcome.judgement.mean.value ||
      !outcome.reference_mean) {
    return "";
  }
  const double change = *outcome.judgement.mean.value - (outcome.gate.ratio ? 1 : 0);
  return outcome.gate.ratio
             ? fmt::format("{:+.2f} % of {:.4g}", 100 * change, *outcome.reference_mean)
             : fmt::format("{:+.3g} from {:.4g}", change, *outcome.reference_mean);
}

std::string Coloured(Verdict verdict, bool colour) {
  std::string text = fmt::format("{:<12}", VerdictName(verdict));
  if (!colour) return text;
  const int code = verdict == Verdict::kPass ? 32 : verdict == Verdict::kFail ? 31 : 33;
  return fmt::format("\033[{}m{}\033[0m", code, text);
}

Verdict VerdictOf(const SabotageOutcome& outcome, bool controls_hold) {
  return outcome.caught() ? Verdict::kPass : controls_hold ? Verdict::kFail : Verdict::kInvalid;
}

std::string CaughtBy(const SabotageOutcome& outcome) {
  std::string text;
  for (const GateOutcome& gate : outcome.gates) {
    text += fmt::format("{}{} {} ({})", text.empty() ? "" : ", ", gate.gate.name,
                        gate.judgement.verdict == Verdict::kFail
                            ? "fails"
                            : fmt::format("is {}", VerdictName(gate.judgement.verdict)),
                        Value(gate));
  }
  return text;
}

std::string Summary(const GateRun& run) {
  std::map<Verdict, int> counts;
  for (const GateOutcome& gate : run.gates) ++counts[gate.judgement.verdict];
  std::string text;
  for (const auto& [verdict, count] : counts) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, VerdictName(verdict));
  }
  if (!run.sabotages.empty()) {
    const auto caught = std::count_if(run.sabotages.begin(), run.sabotages.end(),
                                      [](const SabotageOutcome& one) { return one.caught(); });
    text += fmt::format("; {} of {} sabotages caught", caught, run.sabotages.size());
  }
  return text;
}

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        // XML 1.0 has no other control characters.
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t') escaped += c;
    }
  }
  return escaped;
}

// So that no name or sentence ends a cell or begins a tag.
std::string TableCell(const std::string& text) {
  std::string cell;
  for (const char c : Escaped(text)) cell += c == '|' ? "\\|" : c == '\n' ? " " : std::string(1, c);
  return cell;
}

// A clause to follow a sentence; empty where there is no picture.
std::string Explained(const GateExplanation& explanation) {
  if (explanation.picture.empty()) return "";
  return fmt::format(" Worst at {} frame {}{}: ![picture]({}/{})", explanation.replicate,
                     explanation.frame,
                     explanation.object.empty() ? "" : ", " + TableCell(explanation.object),
                     kGatePictures, explanation.picture);
}

nlohmann::json OutcomeJson(const GateOutcome& outcome) {
  const Judgement& judgement = outcome.judgement;
  const Gate& gate = outcome.gate;
  nlohmann::json bounds = nlohmann::json::object();
  if (gate.bounds.low) bounds["min"] = *gate.bounds.low;
  if (gate.bounds.high) bounds["max"] = *gate.bounds.high;
  nlohmann::json replicates = nlohmann::json::array();
  for (const auto& [replicate, pair] : outcome.data) replicates.push_back(replicate);
  nlohmann::json json{{"name", gate.name},
                      {"verdict", VerdictName(judgement.verdict)},
                      {"why", judgement.why},
                      {"experiment", gate.experiment},
                      {"metric", gate.metric},
                      {"of", What(gate)},
                      {"cells", ChoiceText(gate.where)},
                      {"bounds", bounds},
                      {"bounds_because", gate.why},
                      {"confidence", gate.confidence},
                      {"replicates", replicates},
                      {"values", judgement.values},
                      {"mean", ToJson(judgement.mean)}};
  if (judgement.interval.value) {
    json["interval"] = {judgement.interval.value->low, judgement.interval.value->high};
  }
  if (outcome.reference_mean) json["reference_mean"] = *outcome.reference_mean;
  if (!outcome.bytes.empty()) json["bytes"] = outcome.bytes;
  const Detects detects = SmallestDetected(judgement, gate.bounds, gate.confidence);
  if (detects.fall) json["detects_fall_of"] = *detects.fall;
  if (detects.rise) json["detects_rise_of"] = *detects.rise;
  return json;
}

void AddCase(const std::string& kind, const std::string& name, Verdict verdict,
             const std::string& text, std::string& cases) {
  cases += fmt::format("  <testcase classname=\"tsdfpp.{}\" name=\"{}\">", kind, Escaped(name));
  if (verdict == Verdict::kFail) {
    cases += fmt::format("<failure message=\"{}\"/>", Escaped(text));
  } else if (verdict != Verdict::kPass) {
    cases +=
        fmt::format("<error type=\"{}\" message=\"{}\"/>", VerdictName(verdict), Escaped(text));
  }
  cases += "</testcase>\n";
}

}  // namespace

std::string GateTable(const GateRun& run, bool colour) {
  std::size_t width = 8;
  for (const GateOutcome& gate : run.gates) width = std::max(width, gate.gate.name.size());
  for (const ControlOutcome& one : run.controls) width = std::max(width, one.control.name.size());
  for (const SabotageOutcome& sabotage : run.sabotages) {
    width = std::max(width, SabotageName(sabotage.sabotage).size());
  }
  std::string text;
  if (run.options.sabotage != Sabotage::kNone) {
    text += fmt::format("SABOTAGED: {}\n", SabotageWords(run.options.sabotage));
  }
  const auto line = [&](Verdict verdict, std::string_view name, const std::string& rest) {
    text += fmt::format("{} {:<{}}  {}\n", Coloured(verdict, colour), name, width, rest);
  };
  for (const ControlOutcome& one : run.controls) {
    const std::string why = one.why.empty() ? "" : "; " + one.why;
    line(one.verdict, one.control.name,
         fmt::format("control: {} methods differ in {} by {:.3g}, allowed {:.3g}{}",
                     one.control.methods.size(), one.control.metric, one.greatest_spread,
                     one.control.spread, why));
  }
  for (const GateOutcome& one : run.gates) {
    const std::string why = one.judgement.verdict == Verdict::kInvalid ? "; " + one.judgement.why
                            : one.bytes.empty()                        ? ""
                                                                       : "; bytes " + one.bytes;
    line(one.judgement.verdict, one.gate.name,
         fmt::format("{}: {}, expected {}{}", What(one.gate), Value(one), one.gate.bounds.Text(),
                     why));
  }
  for (const SabotageOutcome& one : run.sabotages) {
    line(VerdictOf(one, run.controls_hold()), SabotageName(one.sabotage),
         "sabotage: " + CaughtBy(one));
  }
  return text + Summary(run) + "\n";
}

nlohmann::json GateJson(const GateRun& run, const GateExplanations& explanations) {
  nlohmann::json gates = nlohmann::json::array();
  for (const GateOutcome& outcome : run.gates) {
    gates.push_back(OutcomeJson(outcome));
    const auto found = explanations.find(outcome.gate.name);
    if (found == explanations.end()) continue;
    gates.back()["explanation"] = {{"replicate", found->second.replicate},
                                   {"frame", found->second.frame},
                                   {"object", found->second.object},
                                   {"picture", found->second.picture}};
  }
  nlohmann::json controls = nlohmann::json::array();
  for (const ControlOutcome& one : run.controls) {
    controls.push_back({{"name", one.control.name},
                        {"verdict", VerdictName(one.verdict)},
                        {"why", one.why},
                        {"metric", one.control.metric},
                        {"methods", one.control.methods},
                        {"greatest_spread", one.greatest_spread},
                        {"allowed_spread", one.control.spread}});
  }
  nlohmann::json sabotages = nlohmann::json::array();
  for (const SabotageOutcome& one : run.sabotages) {
    nlohmann::json meant = nlohmann::json::array();
    for (const GateOutcome& gate : one.gates) meant.push_back(OutcomeJson(gate));
    sabotages.push_back({{"name", SabotageName(one.sabotage)},
                         {"words", SabotageWords(one.sabotage)},
                         {"caught", one.caught()},
                         {"gates", meant}});
  }
  return {{"schema", kGatesSchema},
          {"profile", run.options.profile},
          {"sabotage", SabotageName(run.options.sabotage)},
          {"program", run.environment.program},
          {"renderer", run.environment.renderer},
          {"mujoco", run.environment.mujoco},
          {"machine", run.environment.machine},
          {"exit_code", run.exit_code()},
          {"controls", controls},
          {"gates", gates},
          {"sabotages", sabotages}};
}

std::string GateJUnit(const GateRun& run) {
  std::string cases;
  for (const ControlOutcome& one : run.controls) {
    AddCase("control", one.control.name,
            one.verdict == Verdict::kPass ? Verdict::kPass : Verdict::kInvalid, one.why, cases);
  }
  for (const GateOutcome& one : run.gates) {
    AddCase("gate", one.gate.name, one.judgement.verdict,
            fmt::format("{}: {}", What(one.gate), one.judgement.why), cases);
  }
  for (const SabotageOutcome& one : run.sabotages) {
    AddCase("sabotage", std::string(SabotageName(one.sabotage)),
            VerdictOf(one, run.controls_hold()), "not caught: " + CaughtBy(one), cases);
  }
  const auto count = [&](const std::string& tag) {
    int found = 0;
    for (std::size_t at = cases.find(tag); at != std::string::npos; at = cases.find(tag, at + 1)) {
      ++found;
    }
    return found;
  };
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n <testsuite name=\"tsdfpp gates, "
      "{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\">\n{} </testsuite>\n</testsuites>\n",
      Escaped(run.options.profile), count("<testcase "), count("<failure "), count("<error "),
      cases);
}

std::string GateMarkdown(const GateRun& run, const GateExplanations& explanations) {
  std::string text =
      fmt::format("### Accuracy gates, {}: {}\n\n", run.options.profile, Summary(run));
  if (run.options.sabotage != Sabotage::kNone) {
    text += fmt::format("**Sabotaged: {}.**\n\n", SabotageWords(run.options.sabotage));
  }
  text +=
      "| gate | verdict | value | expected | change against the reference "
      "|\n|---|---|---|---|---|\n";
  for (const ControlOutcome& one : run.controls) {
    text += fmt::format("| {} (control) | {} | {:.3g} | spread at most {:.3g} | |\n",
                        TableCell(one.control.name), VerdictName(one.verdict), one.greatest_spread,
                        one.control.spread);
  }
  for (const GateOutcome& one : run.gates) {
    text += fmt::format(
        "| {} | {}{} | {}: {} | {} | {} |\n", TableCell(one.gate.name), one.passed() ? "" : "**",
        std::string(VerdictName(one.judgement.verdict)) + (one.passed() ? "" : "**"),
        TableCell(What(one.gate)), Value(one), one.gate.bounds.Text(), Change(one));
  }
  for (const GateOutcome& one : run.gates) {
    if (one.passed()) continue;
    text += fmt::format("\n**{}** is {}: {}.", TableCell(one.gate.name),
                        VerdictName(one.judgement.verdict), TableCell(one.judgement.why));
    const auto explanation = explanations.find(one.gate.name);
    if (explanation != explanations.end()) text += Explained(explanation->second);
    text += "\n";
  }
  if (!run.sabotages.empty()) {
    text += "\n| sabotage | caught | by |\n|---|---|---|\n";
    for (const SabotageOutcome& one : run.sabotages) {
      text += fmt::format("| {} | {} | {} |\n", TableCell(std::string(SabotageWords(one.sabotage))),
                          one.caught() ? "yes" : "**no**", TableCell(CaughtBy(one)));
    }
  }
  return text + fmt::format("\ntsdfpp {}; {}; MuJoCo {}; {}\n", run.environment.program,
                            TableCell(run.environment.renderer), run.environment.mujoco,
                            TableCell(run.environment.machine));
}

Expected<void> WriteGateReports(const GateRun& run, const GateExplanations& explanations,
                                const std::filesystem::path& out) {
  // Last, and removed before anything else of it is written (RemoveGateReport): who finds it finds
  // the rest of the same run.
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "gates.junit.xml", GateJUnit(run)));
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "gates.md", GateMarkdown(run, explanations)));
  return WriteFile(out / "gates.json", JsonText(GateJson(run, explanations), 1) + "\n");
}

Expected<void> RemoveGateReport(const std::filesystem::path& out) {
  std::error_code failure;
  std::filesystem::remove(out / "gates.json", failure);
  if (failure) {
    return EnvironmentError("{}: cannot be removed ({})", (out / "gates.json").string(),
                            failure.message());
  }
  return {};
}

}  // namespace tsdfpp
