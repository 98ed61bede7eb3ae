import{ao as p,ap as t,aq as c}from"./index-w8fjWeUi.js";function l(n,s,...e){var r=new c(n);p(()=>{const a=s()??null;r.ensure(a,a&&(o=>a(o,...e)))},t)}export{l as s};
