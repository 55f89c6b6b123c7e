/* Order of search results: pages written by hand, pages of models, the API. Main index entries score 100. */
var Scorer = {
  score: function (result) {
    const page = result[0];
    const score = result[4];
    if (page.startsWith("_generated/api/") && score < 90) return score / 100 - 50;
    if (page.startsWith("_generated/models/") && page !== "_generated/models/index" && score < 90) return score / 4;
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
