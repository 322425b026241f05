// Light or dark as chosen earlier, before the page is drawn. Furo has this line inside its pages.
document.body.dataset.theme = localStorage.getItem("theme") || "auto";
