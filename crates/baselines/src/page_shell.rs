//! What the HTML pages of baselines have in common.

/// Light and dark, in one column on narrow screens.
const STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:16px/1.5 system-ui,sans-serif;margin:1rem auto;max-width:80rem;padding:0 1rem}\
.pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(16rem,100%),1fr));gap:1rem}\
.pair{grid-template-columns:repeat(auto-fit,minmax(min(24rem,100%),1fr))}\
figure{margin:0}\
img,canvas{width:100%;height:auto;border:1px solid #8888;box-sizing:border-box}\
.scroll{overflow-x:auto}\
table{border-collapse:collapse}\
th,td{padding:.1rem .8rem .1rem 0;text-align:right}\
th:first-child,td:first-child{text-align:left}\
.lights{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(20rem,100%),1fr));gap:.2rem 1.5rem;margin:1rem 0}\
.lights label{display:grid;grid-template-columns:minmax(0,1fr) 8rem 3rem;gap:.6rem;align-items:center}\
.lights span{overflow-wrap:anywhere}\
.lights output{text-align:right}";

/// A page of this title and content.
pub(crate) fn page(title: &str, introduction: &str, content: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><style>{STYLE}</style></head><body>\
         <main><h1>{title}</h1>\n<p>{introduction}</p>\n{content}</main></body></html>\n"
    )
}

/// A picture with its caption, which is also its description.
pub(crate) fn figure(address: &str, scene: &str, caption: &str) -> String {
    format!("<figure><img src=\"{address}\" alt=\"{caption}, {scene}\"><figcaption>{caption}</figcaption></figure>\n")
}
