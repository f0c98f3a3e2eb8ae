// Order of search results: how-to pages before all others, results and changes last. The values are Sphinx's.
var Scorer = {
  score: ([docname, , , , score]) => {
    const howTo = [
      "recordings", "diagnose", "identify", "own-physics", "corrected-ship", "ships", "manoeuvring", "observers",
      "evaluate", "loops", "environment", "steering", "train",
    ];
    if (howTo.includes(docname)) return score + 3;
    return /^(results\/|decisions\/|CHANGELOG|CONTRIBUTING|every-result)/.test(docname) ? score - 4 : score;
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
