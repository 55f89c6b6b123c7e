/* What a search puts first: pages written for people, then pages of models, then the API. */
var Scorer = {
  score: function (result) {
    const page = result[0];
    const score = result[4];
    if (page.startsWith("_generated/api/")) return score / 100 - 50;
    if (page.startsWith("_generated/models/") && page !== "_generated/models/index") return score / 4;
    return score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
